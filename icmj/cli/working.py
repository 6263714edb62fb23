"""Progress of commands that take longer than two seconds: a bar on a terminal, otherwise a line every five seconds."""

from __future__ import annotations

import logging
import threading
import time
from contextlib import suppress

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from icmj.base.compiling import compiling
from icmj.cli.terminal import Terminal

FIRST, LEAST = 2.0, 0.7  # s of silence before the first word: since the command began, and since the work did
PAUSE = 5.0  # s between two lines, where there is no terminal to draw a bar on
COMPILING = "compiling, once"
LOG = logging.getLogger("icmj")


class Working:
    """Progress of the current work; a context manager that shows it from a separate thread.

    A command that is done before that says nothing, so that its errors stay alone on their line.
    """

    def __init__(self, label: str, console: Terminal) -> None:
        self._label, self._done, self._console = label, 0.0, console
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True)

    def tell(self, label: str, done: float | None = None) -> None:
        """Set the label of the current work and, if known, the completed fraction (0–1)."""
        if label != self._label:
            LOG.info(label)
        self._label = label
        self._done = self._done if done is None else done

    def __enter__(self) -> Working:
        LOG.info(self._label)
        if not self._console.brief:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(2)

    def _silence(self) -> float:
        """The time [s] after which progress is first shown; importing libraries has already taken a part of it."""
        return max(min(LEAST, FIRST), FIRST - (time.monotonic() - self._console.began))

    def _show(self) -> None:
        if self._console.is_terminal:
            self._bar()
        else:
            self._lines()

    def _bar(self) -> None:
        if self._ended.wait(self._silence()):
            return
        columns = TextColumn("{task.description:<24}", markup=False), BarColumn(), TimeElapsedColumn()
        # nobody may listen any more
        with suppress(OSError, ValueError), Progress(*columns, console=self._console, transient=True) as bar:
            task = bar.add_task(self._label, total=None)
            while not self._ended.wait(0.1):
                label = f"{self._label}: {COMPILING}" if compiling() else self._label
                bar.update(task, description=label, completed=self._done, total=1.0 if self._done > 0 else None)

    def _lines(self) -> None:
        start, pause = self._console.began, self._silence()
        while not self._ended.wait(pause):
            part = f", {100 * self._done:.0f} %" if self._done > 0 else ""
            what = f": {COMPILING}," if compiling() else ""
            self._console.say(f"icmj: {self._label}{part}{what} after {time.monotonic() - start:.0f} s", wrap=False)
            pause = PAUSE
