"""The terminal: standard output and standard error, on which all that the command line prints is shown as it is.

No control character in names, units and contents of files is obeyed, nothing of them is taken for markup, and what a
stream cannot encode is spelt.
"""

from __future__ import annotations

import contextlib
import json
import logging
import time
from collections.abc import Iterable, Iterator
from typing import Any

from rich.console import Console, ConsoleDimensions, ConsoleOptions, RenderableType
from rich.segment import Segment

from icmj.base.text import strip_controls

ENDLESS = 100_000  # columns of a stream that is no terminal


class Terminal(Console):
    """Standard output, or standard error, whose write errors are ignored.

    Attributes:
        brief: leave out notes, as ``--quiet`` asks.
        began: when the present command began, by ``time.monotonic``.
        progressed: when its last line of progress was printed; ``None`` before the first.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)
        self.brief, self.began = False, time.monotonic()
        self.progressed: float | None = None

    @property  # type: ignore[misc]  # nobody sets it
    def size(self) -> ConsoleDimensions:
        """Size of the terminal; a file or a pipe counts as so wide that nothing is wrapped or cut."""
        there = super().size
        return there if self.is_terminal else ConsoleDimensions(ENDLESS, there.height)

    def note(self, words: object) -> None:
        """Print a note on a result on one line."""
        if not self.brief:
            self.say(f"note: {words}", style="yellow")

    def say(self, words: object, *, style: str | None = None, wrap: bool = True) -> None:
        """One line, which a terminal may wrap."""
        self.print(str(words).replace("\n", " "), style=style, soft_wrap=not wrap)

    def show(self, record: object, *, indent: int | None = 2) -> None:
        """A record as JSON, in ASCII."""
        self.file.write(strip_controls(json.dumps(record, indent=indent, allow_nan=False)) + "\n")

    def print(self, *objects: Any, **options: Any) -> None:
        """Print like rich; errors of standard error are ignored."""
        with contextlib.suppress(OSError, ValueError) if self.stderr else contextlib.nullcontext():
            super().print(*objects, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render segments with control characters removed, except rich's own."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(strip_controls(segment.text), segment.style)

    def on_broken_pipe(self) -> None:
        """Raise BrokenPipeError where the reader closed the pipe; rich would exit the process."""
        raise BrokenPipeError


OUT, ERR = Terminal(), Terminal(stderr=True)


@contextlib.contextmanager
def apply_verbosity(quiet: bool, verbose: bool) -> Iterator[None]:
    """Within the block, apply ``--quiet`` (no notes, no progress) and ``--verbose`` (log every step)."""
    log, handler = logging.getLogger("icmj"), logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(name)s: %(message)s"))
    level = log.level
    OUT.brief = ERR.brief = quiet
    OUT.began = ERR.began = time.monotonic()
    OUT.progressed = ERR.progressed = None
    if verbose:
        log.addHandler(handler)
        log.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        OUT.brief = ERR.brief = False
        log.removeHandler(handler)
        log.setLevel(level)
