"""The terminal: everything printed to standard output and standard error goes through this module.

Names, units and contents of files are shown as what they are: no control character of theirs is obeyed, nothing of them
is taken for markup. Where a stream cannot encode a character, it is spelt.

Tables for terminals of any width: less important columns are dropped first, then the table becomes a list.

Progress of commands that take longer than two seconds, with the time that remains.

On a terminal it is one line that changes in place. Elsewhere it is a line on standard error after 2 s, and another
each time that the time which has passed has doubled: after 7, 14, 28, 56 s, so that ten minutes have eight lines.
"""

from __future__ import annotations

import contextlib
import json
import logging
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleDimensions, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.segment import Segment
from rich.table import Column as RichColumn
from rich.table import Table

from icmj.base import compile_clock
from icmj.base.text import printable

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
        self.file.write(printable(json.dumps(record, indent=indent, allow_nan=False)) + "\n")

    def print(self, *objects: Any, **options: Any) -> None:
        """Print like rich; errors of standard error are ignored."""
        with contextlib.suppress(OSError, ValueError) if self.stderr else contextlib.nullcontext():
            super().print(*objects, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render segments with control characters removed, except rich's own."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(printable(segment.text), segment.style)

    def on_broken_pipe(self) -> None:
        """Raise BrokenPipeError where the reader closed the pipe; rich would exit the process."""
        raise BrokenPipeError


OUT, ERR = Terminal(), Terminal(stderr=True)


@contextlib.contextmanager
def talking(quiet: bool, verbose: bool) -> Iterator[None]:
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


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: its head.
        justify: ``left``, ``right`` or ``center``.
        rank: columns of rank 0 stay; of the others the one with the highest rank is left out first.
    """

    name: str
    justify: str = "left"
    rank: int = 0


def show_table(
    columns: Sequence[Column],
    rows: Sequence[Sequence[str]],
    out: Terminal,
    *,
    title: str = "",
    keys: int = 1,
    sections: Sequence[int] = (),
) -> None:
    """Print a table in which nothing is cut, however wide ``out`` is.

    Args:
        columns: its columns.
        rows: a cell for each column.
        out: where it is printed.
        title: stands above it.
        keys: how many columns, from the left, say what a row is of: they head its entry where the table is a list.
        sections: rows after which a line is left free.
    """
    rows = [[cell.replace("−", "-") for cell in row] for row in rows]  # as programs read numbers that are copied
    kept = list(range(len(columns)))
    while (table := _fitting(columns, rows, kept, title, sections, out)) is None:
        last = max(kept, key=lambda i: columns[i].rank)
        if columns[last].rank == 0:
            _show_list(columns, rows, out, title, keys)
            return
        kept.remove(last)
    out.print(table)
    if len(kept) < len(columns):
        left_out = ", ".join(column.name for i, column in enumerate(columns) if i not in kept)
        out.say(f"A wider terminal also shows: {left_out}.", style="dim")


def _fitting(
    columns: Sequence[Column],
    rows: Sequence[Sequence[str]],
    kept: Sequence[int],
    title: str,
    sections: Sequence[int],
    out: Terminal,
) -> Table | None:
    """The table with these columns, closer together if need be; ``None`` where ``out`` is too narrow for it."""
    for close in (False, True):
        table = Table(box=SIMPLE_HEAD, show_edge=not close, padding=(0, 0 if close else 1, 0, 0))
        table.show_header = any(columns[i].name for i in kept)
        for i in kept:
            table.add_column(columns[i].name, justify=columns[i].justify, no_wrap=True)  # type: ignore[arg-type]
        for number, row in enumerate(rows):
            table.add_row(*(row[i] for i in kept), end_section=number in sections)
        if Measurement.get(out, out.options.update(max_width=ENDLESS), table).maximum <= out.width:
            table.title, table.title_justify = title or None, "left"  # may be wrapped
            return table
    return None


def _show_list(columns: Sequence[Column], rows: Sequence[Sequence[str]], out: Terminal, title: str, keys: int) -> None:
    """Each row as a paragraph, whose cells stand one beneath the other."""
    if title:
        out.say(title, style="italic")
    label = max(len(column.name) for column in columns[keys:])
    for row in rows:
        out.say("")
        out.say(", ".join(filter(None, row[:keys])), wrap=False)
        for column, cell in zip(columns[keys:], row[keys:], strict=True):
            if cell:
                out.say(f"  {column.name:<{label}}  {cell}".rstrip() if label else f"  {cell}", wrap=False)


FIRST, LEAST = 2.0, 0.7  # s of silence before the first word: since the command began, and since the work did
PAUSE, SHARE, LONGEST = 5.0, 1.0, 600.0  # s between two lines without a terminal; as a share of the time until then
ENOUGH, PART, LONG = 2.0, 0.03, 30.0  # s of work with this part done, or s of work, from which an estimate is made
LOG = logging.getLogger("icmj")


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
            LOG.info(label)
        self._label = label
        if done is not None:
            self._remaining.note(done)

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
        return max(min(LEAST, FIRST), self._due() - time.monotonic())

    def _due(self) -> float:
        """When the next line is due, by ``time.monotonic``: the works of one command share its lines."""
        began, last = self._console.began, self._console.progressed
        return began + FIRST if last is None else last + min(max(PAUSE, SHARE * (last - began)), LONGEST)

    def _show(self) -> None:
        if self._console.is_terminal:
            self._bar()
        else:
            self._lines()

    def _bar(self) -> None:
        if self._ended.wait(self._silence()):
            return
        label = TextColumn("{task.description}", markup=False, table_column=RichColumn(no_wrap=True, ratio=1))
        columns = label, BarColumn(20), TimeElapsedColumn(), TextColumn("{task.fields[left]}")
        # nobody may read any more
        with suppress(OSError, ValueError), Progress(*columns, console=self._console, transient=True) as bar:
            task = bar.add_task(self._label, total=None, left="")
            while not self._ended.wait(0.1):
                done, parts = self._remaining.done, [self._label, _compilation()]
                total = 1.0 if done > 0 else None
                words = ", ".join(part for part in parts if part)
                bar.update(task, description=words, completed=done, total=total, left=self._remaining.words())

    def _lines(self) -> None:
        while not self._ended.wait(self._silence()):
            done = self._remaining.done
            now = self._console.progressed = time.monotonic()
            parts = [
                self._label,
                f"{100 * done:.0f} %" if done > 0 else "",
                _compilation(),
                f"after {now - self._console.began:.0f} s",
                self._remaining.words(),
            ]
            self._console.say(f"icmj: {', '.join(part for part in parts if part)}", wrap=False)


class Remaining:
    """The time that work will still take, from the fraction that was completed since it was first stated.

    What passes while loops are compiled does not count. Where the fraction falls, other work has begun.
    """

    def __init__(self) -> None:
        self.done = 0.0
        self._first: float | None = None
        self._begin = self._at = self._clock()

    @staticmethod
    def _clock() -> float:
        return time.monotonic() - compile_clock.spent()

    def note(self, done: float) -> None:
        """The completed fraction, now."""
        now = self._clock()
        if self._first is None or done < self.done:
            self._begin, self._first = now, done
        if done != self.done:
            self._at = now
        self.done = done

    def seconds(self) -> float | None:
        """An estimate; ``None`` where there is none, or it has passed already."""
        gained, worked = self.done - (self._first or 0.0), self._at - self._begin
        if gained <= 0 or worked < (ENOUGH if gained >= PART else LONG):
            return None
        left = worked * (1 - self.done) / gained - (self._clock() - self._at)
        return left + _time_to_compile() if left > 0 else None

    def words(self) -> str:
        """The estimate; empty where there is none."""
        seconds = self.seconds()
        return f"about {_rounded(seconds)} left" if seconds is not None and seconds >= 1 else ""


def _time_to_compile() -> float:
    """The time that a loop which is compiled now will still take, or 0 [s]."""
    return max(compile_clock.USUAL - compile_clock.spent(), 0.0) if compile_clock.compiling() else 0.0


def _compilation() -> str:
    """What is said of a loop that is compiled now; empty where none is."""
    if not compile_clock.compiling():
        return ""
    left = _time_to_compile()
    return f"compiling (first run only{f', about {_rounded(left)}' if left >= 1 else ''})"


def _rounded(seconds: float) -> str:
    """To whole seconds, or to five of them or two digits where there are many."""
    from icmj.base.numbers import lapse

    step = 1 if seconds < 10 else 5
    return lapse(step * round(seconds / step), 2)
