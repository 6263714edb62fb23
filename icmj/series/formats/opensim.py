"""OpenSim's .mot and .sto: a header and a table of text, whose columns have units by OpenSim's conventions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.csv_table import LONGEST_LINE
from icmj.series.formats import FORMATS
from icmj.series.series import Series

SUFFIXES = (".mot", ".sto")
LINES = 190  # in which the header must end, so that numbers begin where they are looked for
# by the end of a column's name: of ground reactions, translations, inverse dynamics, muscles
_UNITS = (
    (r"_v[xyz]", "N"),
    (r"_p[xyz]", "m"),
    (r"(torque_|_m)[xyz]", "N m"),
    (r"_t[xyz]", "m"),
    (r"_moment", "N m"),
    (r"_force", "N"),
    (r"/fiber_length", "m"),
    (r"/activation", ""),
)
_ANGLES = {"yes": "deg", "no": "rad"}
# coordinates of OpenSim's models that are angles say so; a slider may have any name
_ANGLE = re.compile(r"angle|tilt|list|rot|flex|exten|add|abd|bend|pro_sup|_dev|_r[xyz]$", re.IGNORECASE)


@dataclass(frozen=True)
class Header:
    """The header of a file, before its table.

    Attributes:
        coordinates: whether its columns are coordinates of a model.
        angle: the unit of angles; "" where it does not say.
        rows: how many rows it promises; ``None`` where it does not.
    """

    coordinates: bool
    angle: str
    rows: int | None

    def unit_of(self, name: str) -> str:
        """The unit of a column by its name; "" where no convention gives one."""
        value = re.sub(r"/value$", "", name)
        speed = name.endswith("/speed")
        value = re.sub(r"/speed$", "", value)
        known = next((unit for end, unit in _UNITS if re.search(f"{end}$", value)), None)
        if known is None:
            known = self.angle if (self.coordinates or value != name) and _ANGLE.search(value) else ""
        return f"{known}/s" if speed and known else known


def read_header(lines: Iterable[bytes]) -> Header:
    """Read the header, up to the line ``endheader``.

    Raises:
        DataError: if it does not end, the table is not one of numbers, or a number of rows or a unit of angles is none.
    """
    told: dict[str, str] = {}
    title = ""
    for number, line in enumerate(lines):
        words = line.decode(errors="replace").strip()
        title = title or words.lower()
        if words.lower().startswith("endheader"):
            break
        if number >= LINES:
            raise DataError("no line 'endheader' where a header of OpenSim would end; expected a .mot or .sto file")
        key, _, value = words.replace(" ", "=", 1).partition("=") if "=" not in words else words.partition("=")
        told[key.strip().lower()] = value.strip()
    else:
        raise DataError("no line 'endheader'; expected a .mot or .sto file of OpenSim")
    kind = told.get("datatype", "double").lower()
    if kind != "double":
        raise DataError(f"a table of {one_line(kind, 40)}; convert it to numbers, as TimeSeriesTable.flatten does")
    rows, degrees = told.get("nrows", told.get("datarows")), told.get("indegrees")
    if rows is not None and not re.fullmatch(r"[0-9]{1,18}", rows):
        raise DataError(f"nRows={one_line(rows, 40)} in its header; expected a number of rows")
    if degrees is not None and degrees.lower() not in _ANGLES:
        raise DataError(f"inDegrees={one_line(degrees, 40)} in its header; expected yes or no")
    return Header(
        coordinates="coordinates" in title or "kinematics" in title,
        angle="" if degrees is None else _ANGLES[degrees.lower()],
        rows=None if rows is None else int(rows),
    )


def read(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> tuple[Series, ...]:
    header = read_header(islice(iter(lambda: file.readline(LONGEST_LINE + 1), b""), LINES + 1))
    file.seek(0)
    trials: tuple[Series, ...] = FORMATS[FORMATS.names[0]].read(path, file, columns, rate)
    if header.rows is not None and header.rows != (rows := sum(map(len, trials))):
        raise DataError(f"{rows} rows where its header says {header.rows}; was it cut short?")
    return tuple(replace(one, units=tuple(map(header.unit_of, one.names))) for one in trials)
