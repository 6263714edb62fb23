"""Tables for terminals of any width: less important columns are dropped first, then the table becomes a list."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from icmj.cli.terminal import Terminal

_ENDLESS = 100_000  # columns of the terminal, more than any table has


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
    while (table := _fit_table(columns, rows, kept, title, sections, out)) is None:
        last = max(kept, key=lambda i: columns[i].rank)
        if columns[last].rank == 0:
            _show_list(columns, rows, out, title, keys)
            return
        kept.remove(last)
    out.print(table)
    if len(kept) < len(columns):
        left_out = ", ".join(column.name for i, column in enumerate(columns) if i not in kept)
        out.say(f"A wider terminal also shows: {left_out}.", style="dim")


def _fit_table(
    columns: Sequence[Column],
    rows: Sequence[Sequence[str]],
    kept: Sequence[int],
    title: str,
    sections: Sequence[int],
    out: Terminal,
) -> Table | None:
    """The table with these columns, closer together if need be; ``None`` where ``out`` is too narrow for it."""
    from rich.box import SIMPLE_HEAD
    from rich.measure import Measurement
    from rich.table import Table

    for close in (False, True):
        table = Table(box=SIMPLE_HEAD, show_edge=not close, padding=(0, 0 if close else 1, 0, 0))
        table.show_header = any(columns[i].name for i in kept)
        for i in kept:
            table.add_column(columns[i].name, justify=columns[i].justify, no_wrap=True)  # type: ignore[arg-type]
        for number, row in enumerate(rows):
            table.add_row(*(row[i] for i in kept), end_section=number in sections)
        if Measurement.get(out, out.options.update(max_width=_ENDLESS), table).maximum <= out.width:
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
