"""The terminal: the one place through which words reach standard output and standard error.

Names, units and contents of files are shown as what they are: no control character of theirs is obeyed, nothing of them
is taken for markup. Where a stream cannot encode a character, it is spelt.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from icmj.base.text import printable


class Terminal(Console):
    """Standard output, or standard error, of which nobody depends on being heard."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def say(self, words: object, *, style: str | None = None, wrap: bool = True) -> None:
        """One line, which a terminal may wrap."""
        self.print(str(words).replace("\n", " "), style=style, soft_wrap=not wrap)

    def show(self, record: object, *, indent: int | None = 2) -> None:
        """A record as JSON, in ASCII."""
        self.file.write(printable(json.dumps(record, indent=indent, allow_nan=False)) + "\n")

    def print(self, *objects: Any, **options: Any) -> None:
        """As rich prints; what cannot be said on standard error stops nothing."""
        with contextlib.suppress(OSError, ValueError) if self.stderr else contextlib.nullcontext():
            super().print(*objects, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """What is printed, piece by piece, without what a terminal would obey."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(printable(segment.text), segment.style)

    def on_broken_pipe(self) -> None:
        """The reader went away; rich would end the process."""
        raise BrokenPipeError


OUT, ERR = Terminal(), Terminal(stderr=True)
