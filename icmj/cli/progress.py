"""Progress of commands that take longer than two seconds, with the time that remains.

On a terminal it is one line that changes in place. Elsewhere it is a line on standard error after 2 s, and another
each time that the time which has passed has doubled: after 7, 14, 28, 56 s, so that ten minutes have eight lines.
"""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from icmj.base import compile_clock

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal

FIRST, LEAST = 2.0, 0.7  # s of silence before the first word: since the command began, and since the work did
PAUSE, SHARE, LONGEST = 5.0, 1.0, 600.0  # s between two lines without a terminal; as a share of the time until then
ENOUGH, PART, LONG = 2.0, 0.03, 30.0  # s of work with this part done, or s of work, from which an estimate is made


class Working:
    """Progress of the current work; a context manager that shows it from a separate thread.

    A command that is done before that says nothing, so that its errors stay alone on their line.
    """

    def __init__(self, label: str, console: Terminal) -> None:
        self._label, self._console = label, console
        self._remaining = Remaining()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True)

    def tell(self, label: str, done: float | None = None) -> None:
        """Set the label of the current work and, if known, the completed fraction (0–1)."""
        if label != self._label:
            _log(label)
        self._label = label
        if done is not None:
            self._remaining.note(done)

    def __enter__(self) -> Working:
        _log(self._label)
        if not self._console.brief:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(2)

    def _find_silence(self) -> float:
        """The time [s] after which progress is first shown; importing libraries has already taken a part of it."""
        return max(min(LEAST, FIRST), self._find_due() - time.monotonic())

    def _find_due(self) -> float:
        """When the next line is due, by ``time.monotonic``: the works of one command share its lines."""
        began, last = self._console.began, self._console.progressed
        return began + FIRST if last is None else last + min(max(PAUSE, SHARE * (last - began)), LONGEST)

    def _show(self) -> None:
        if self._console.is_terminal:
            self._show_bar()
        else:
            self._say_lines()

    def _show_bar(self) -> None:
        if self._ended.wait(self._find_silence()):
            return
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.table import Column as RichColumn

        label = TextColumn("{task.description}", markup=False, table_column=RichColumn(no_wrap=True, ratio=1))
        columns = label, BarColumn(20), TimeElapsedColumn(), TextColumn("{task.fields[left]}")
        # nobody may read any more
        with suppress(OSError, ValueError), Progress(*columns, console=self._console, transient=True) as bar:
            task = bar.add_task(self._label, total=None, left="")
            while not self._ended.wait(0.1):
                done, parts = self._remaining.done, [self._label, _say_compilation()]
                total = 1.0 if done > 0 else None
                words = ", ".join(part for part in parts if part)
                bar.update(task, description=words, completed=done, total=total, left=self._remaining.say())

    def _say_lines(self) -> None:
        while not self._ended.wait(self._find_silence()):
            done = self._remaining.done
            now = self._console.progressed = time.monotonic()
            parts = [
                self._label,
                f"{100 * done:.0f} %" if done > 0 else "",
                _say_compilation(),
                f"after {now - self._console.began:.0f} s",
                self._remaining.say(),
            ]
            self._console.say(f"icmj: {', '.join(part for part in parts if part)}", wrap=False)


class Remaining:
    """The time that work will still take, from the fraction that was completed since it was first stated.

    What passes while loops are compiled does not count. Where the fraction falls, other work has begun.
    """

    def __init__(self) -> None:
        self.done = 0.0
        self._first: float | None = None
        self._begin = self._at = self._read_clock()

    @staticmethod
    def _read_clock() -> float:
        return time.monotonic() - compile_clock.read_compile_time()

    def note(self, done: float) -> None:
        """The completed fraction, now."""
        now = self._read_clock()
        if self._first is None or done < self.done:
            self._begin, self._first = now, done
        if done != self.done:
            self._at = now
        self.done = done

    def estimate(self) -> float | None:
        """An estimate; ``None`` where there is none, or it has passed already."""
        gained, worked = self.done - (self._first or 0.0), self._at - self._begin
        if gained <= 0 or worked < (ENOUGH if gained >= PART else LONG):
            return None
        left = worked * (1 - self.done) / gained - (self._read_clock() - self._at)
        return left + _estimate_compilation() if left > 0 else None

    def say(self) -> str:
        """The estimate; empty where there is none."""
        seconds = self.estimate()
        return f"about {_round_time(seconds)} left" if seconds is not None and seconds >= 1 else ""


def _log(label: str) -> None:
    from logging import getLogger

    getLogger("icmj").info(label)


def _estimate_compilation() -> float:
    """The time that a loop which is compiled now will still take, or 0 [s]."""
    return max(compile_clock.USUAL - compile_clock.read_compile_time(), 0.0) if compile_clock.is_compiling() else 0.0


def _say_compilation() -> str:
    """What is said of a loop that is compiled now; empty where none is."""
    if not compile_clock.is_compiling():
        return ""
    left = _estimate_compilation()
    return f"compiling (first run only{f', about {_round_time(left)}' if left >= 1 else ''})"


def _round_time(seconds: float) -> str:
    """To whole seconds, or to five of them or two digits where there are many."""
    from icmj.base.numbers import format_duration

    step = 1 if seconds < 10 else 5
    return format_duration(step * round(seconds / step), 2)
