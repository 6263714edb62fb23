"""Tables that list recordings: one of people, or the public data set's own (Santos and Duarte 2016)."""

from __future__ import annotations

import csv
import io
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from icmj.base.files import read_bytes
from icmj.base.text import one_line
from icmj.errors import FitError

INFO = "BDSinfo.txt"
MOST = 10_000
"""Recordings that a table may list, and trials that they may hold: those of so many take half a gigabyte."""
_MOST_BYTES = 10_000_000  # of a table


@dataclass(frozen=True)
class PublicTrial:
    """One trial of the public data set of Santos and Duarte (2016).

    Attributes:
        file: its text file.
        person: number of the person.
        vision, surface: ``Open`` or ``Closed``, ``Firm`` or ``Foam``.
        group: age group, ``Young`` or ``Old``; "" if the table has none.
    """

    file: Path
    person: str
    vision: str
    surface: str
    group: str = ""


def public_trials(folder: Path | str, people: Sequence[str | int] = ()) -> tuple[PublicTrial, ...]:
    """The trials in a folder with the text files of the public data set, as listed in its table ``BDSinfo.txt``.

    Each file, such as ``BDS00001.txt``, has the columns Time[s], forces, moments, COPx[cm] and COPy[cm]; x is front to
    back. :func:`icmj.fits.read_trials` reads these files.

    Args:
        folder: folder with ``BDSinfo.txt`` and the files.
        people: numbers of the requested people; by default all people whose files are in the folder.

    Raises:
        FitError: if the table cannot be read, or none of its files is in the folder.
    """
    table, needed = Path(folder) / INFO, ("Trial", "Subject", "Vision", "Surface")
    names, rows = read_table(table, (*needed, "AgeGroup"), required=needed, delimiter="\t")
    missing = [name for name in needed if name not in names]
    if missing:
        raise FitError(f"{table}: no column {missing[0]}; expected the table of the data set, separated by tabs")
    wanted = {str(person) for person in people}
    found = tuple(
        PublicTrial(
            Path(folder) / f"{Path(row['Trial']).name}.txt",
            row["Subject"],
            row["Vision"],
            row["Surface"],
            row.get("AgeGroup", ""),
        )
        for row in rows
        if not wanted or row["Subject"] in wanted
    )
    there = tuple(one for one in found if os.path.isfile(one.file))  # no name of a file at all is none, too
    if not there:
        raise FitError(f"{folder}: has none of the {len(found)} files that {INFO} names")
    return there


def read_table(
    path: Path, columns: Sequence[str], *, required: Sequence[str], delimiter: str = ","
) -> tuple[tuple[str, ...], list[dict[str, str]]]:
    """The table of recordings in a text file: its header, and of each row the cells of some columns.

    Cells lose surrounding white space. Empty lines, and comments (#) before the header, are left out; cells that a
    short row lacks are empty.

    Args:
        path: a text file, whose first line names the columns.
        columns: those that are read, where the file has them.
        required: those of them that no row may lack.
        delimiter: between cells; those of a table with tabs have no quotes around them.

    Raises:
        FitError: one line that names the file and the line in it, if it cannot be read, is too large, names a column
            twice, or a row has more cells than the header or lacks one that is required.
    """
    tabs = delimiter == "\t"
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig", "replace" if tabs else "strict")
        quoting: Literal[0, 3] = csv.QUOTE_NONE if tabs else csv.QUOTE_MINIMAL
        lines = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, quoting=quoting, strict=True)
        head: list[str] = next(lines, [])
        while not tabs and head and head[0].startswith("#"):
            head = next(lines, [])
        names = tuple(cell.strip() for cell in head)
        twice = [name for name, count in Counter(names).items() if count > 1 and name in columns]
        if twice:
            raise FitError(f"{path}: has the column {twice[0]!r} twice")
        at = {name: names.index(name) for name in columns if name in names}
        rows = []
        for cells in lines:
            if not any(map(str.strip, cells)):
                continue
            where = f"{path}, line {lines.line_num}"
            if any(map(str.strip, cells[len(names) :])):
                raise FitError(f"{where}: has {len(cells)} cells, and the header {len(names)}")
            row = {name: cells[i].strip() if i < len(cells) else "" for name, i in at.items()}
            if not all(row[name] for name in required if name in row):
                raise FitError(f"{where}: lacks the {' or the '.join(required)}")
            rows.append(row)
            if len(rows) > MOST:
                raise FitError(f"{path}: lists more than {MOST} recordings; fit them in parts")
    except OSError as error:
        raise FitError(f"{path}: cannot be read ({error.strerror})") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise FitError(f"{path}: is not a table of text ({one_line(error, 100)})") from error
    return names, rows
