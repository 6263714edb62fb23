"""Formats of recordings: CSV, OpenSim, C3D.

The shape of a CSV file: where its numbers begin, what separates them, and the names of its columns.

The header of OpenSim's .mot and .sto files, and the units that its columns have by OpenSim's conventions.

C3D files of motion capture and force plates, read by ezc3d in a separate process.

ezc3d is the maintained reader of this format, with a peer-reviewed description and with the centre of pressure of all
types of force plates. A damaged file can end the process that reads it, so that this is another one, with limits on
time and memory; it hands the signals back as arrays.
"""

from __future__ import annotations

import csv
import importlib.util
import os
import re
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from icmj.base.array import Array
from icmj.base.files import open_file
from icmj.base.process import run_bounded
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.c3d_reader import REFUSED
from icmj.series.series import place

HEAD = 200  # lines in which the numbers must begin
LONGEST_LINE = 200_000  # bytes of one line

_LINE = re.compile(rb"[^\r\n]*(?:\r\n?|\n)|[^\r\n]+")
_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")
_MISSING = ("", "-", "na", "n/a", "nan", "inf", "-inf", "null", "none")


@dataclass(frozen=True)
class CsvShape:
    """The format of a CSV file.

    Attributes:
        headers: of all columns; "" where there is none.
        numeric: which columns hold numbers in their first row.
        delimiter: between fields; a blank stands for any number of them.
        decimal: "." or ",".
        first: the line where numbers begin, counted from 1.
        offset: where that is in the file [bytes].
    """

    headers: tuple[str, ...]
    numeric: tuple[bool, ...]
    delimiter: str
    decimal: str
    first: int
    offset: int

    def table(self, rows: bytes) -> bytes:
        """Some rows of numbers, with one ``delimiter`` between their fields."""
        if self.delimiter != " ":
            return rows
        return re.sub(rb" +", b" ", re.sub(rb"(?m)^ +| +(?=\r?$)", b"", rows))


def csv_shape(text: bytes) -> CsvShape:
    """The shape of a CSV file from its first ``HEAD`` lines: numbers begin with two lines of the same form.

    Raises:
        DataError: if it is no text, or no row of numbers is among them.
    """
    if not text.strip():
        raise DataError("the file is empty")
    if b"\0" in text[:LONGEST_LINE]:
        raise DataError("not text; expected CSV, Parquet (.parquet) or npz (.npz)")
    lines, before = _lines(text), ""
    for number, line in enumerate(lines, 1):
        words = line.words
        if not words or words.startswith(("#", "%")):
            before = words.lstrip("#% ") or before
            continue
        row = _Row.of(words)
        following = next((other.words for other in lines[number:] if other.words), None)
        if row.numbers and (following is None or row.alike(_Row.of(following))):
            headers = _fields(before, row.delimiter) if before else []
            if len(headers) != len(row.fields):
                headers = [""] * len(row.fields)
            decimal = "," if row.delimiter != "," and any("," in field for field in row.numbers) else "."
            return CsvShape(tuple(headers), row.numeric, row.delimiter, decimal, number, line.offset)
        before = words
    raise DataError(f"no rows of numbers in its first {len(lines)} lines (the last is {one_line(before, 60)!r})")


@dataclass(frozen=True)
class _Line:
    """A line of the file: its text without surrounding white space, and its offset [bytes]."""

    words: str
    offset: int


@dataclass(frozen=True)
class _Row:
    """The fields of a line."""

    fields: tuple[str, ...]
    delimiter: str

    @classmethod
    def of(cls, words: str) -> _Row:
        delimiter = next((candidate for candidate in ";\t," if candidate in words), " ")
        return cls(tuple(_fields(words, delimiter)), delimiter)

    @property
    def numbers(self) -> list[str]:
        return [field for field in self.fields if _NUMBER.fullmatch(field)]

    @property
    def numeric(self) -> tuple[bool, ...]:
        """Whether each field is a number, or stands for a missing one."""
        return tuple(bool(_NUMBER.fullmatch(field)) or field.lower() in _MISSING for field in self.fields)

    def alike(self, other: _Row) -> bool:
        return (self.delimiter, self.numeric) == (other.delimiter, other.numeric)


def _lines(text: bytes) -> list[_Line]:
    found: list[_Line] = []
    offset = 0
    for number, raw in enumerate(islice((line.group() for line in _LINE.finditer(text)), HEAD), 1):
        if len(raw) > LONGEST_LINE:
            raise DataError(f"line {number} has more than {LONGEST_LINE} characters; expected a table")
        try:
            words = raw.decode("utf-8-sig").strip()
        except UnicodeDecodeError as error:
            raise DataError(f"line {number} is not UTF-8 text; save the file as UTF-8") from error
        found.append(_Line(words, offset))
        offset += len(raw)
    return found


def _fields(words: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return words.split()
    try:
        return [field.strip() for field in next(csv.reader([words], delimiter=delimiter), [])]
    except csv.Error as error:
        raise DataError(f"a line that is not a row of a table ({error})") from error


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


def header_of(lines: Iterable[bytes]) -> Header:
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


LONGEST_READ = 120.0  # s on the clock
# bytes of addresses: at most, for the libraries, and for each byte of a file, of which ezc3d takes 14 for floats
MEMORY, LIBRARIES, PER_BYTE = 1_400_000_000, 400_000_000, 30
_MOST = 65535  # frames that a header can count
GROUPS = ("centres of pressure", "forces", "points", "analog channels", "centres of single plates")
# each more takes 40 MB of the addresses that the reader may use, on a machine of sixty processors all of them
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_READER = Path(__file__).parent / "c3d_reader.py"


@dataclass(frozen=True)
class Group:
    """Signals of one kind, which share a rate.

    Attributes:
        kind: one of :data:`GROUPS`.
        names, units: of the signals.
        rate: rows per second [Hz].
        start: of the first row [s].
        values: shape (N, w).
        fault: why there are none of these though there should be; "" if there are.
    """

    kind: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    rate: float
    start: float
    values: Array
    fault: str = ""


def groups_of(path: Path, longest: float = LONGEST_READ) -> tuple[Group, ...]:
    """The groups of a C3D file that have signals: centres of pressure and forces of plates, points, analog channels.

    Raises:
        DataError: if ezc3d is not installed, the file cannot be read, or it has fewer frames than its header says.
        OSError: if it cannot be opened.
    """
    if importlib.util.find_spec("ezc3d") is None:
        raise DataError("ezc3d, which reads C3D, is not installed; `pip install ezc3d`")
    with tempfile.TemporaryDirectory(prefix="icmj-c3d-") as folder:
        found = Path(folder, "found.npz")
        try:
            command = [sys.executable, "-I", str(_READER), str(path.absolute()), str(found)]
            most = min(MEMORY, LIBRARIES + PER_BYTE * path.stat().st_size)
            done = run_bounded(command, longest, addresses=most, environment=_ONE_THREAD)
        except subprocess.TimeoutExpired as error:
            raise DataError(f"not a C3D file that can be read (it takes more than {longest:g} s)") from error
        if done.returncode or not found.exists():
            said = done.stderr.strip().splitlines()
            own = said and done.returncode == REFUSED
            why = one_line(said[-1], 120) if own else f"reading it ended the reader, which may use {MEMORY / 1e9:g} GB"
            raise DataError(f"not a C3D file that can be read ({why})")
        with np.load(found, allow_pickle=False) as data:
            _refuse_part(int(data["frames"][0]), _frames(path, data["ends"].tolist()))
            fault = one_line(data["fault"].item(), 120)
            lost = (Group(GROUPS[0], (), (), 0.0, 0.0, np.empty((0, 0)), fault),) if fault else ()
            return lost + tuple(
                Group(
                    kind,
                    tuple(data[f"{i} names"].tolist()),
                    tuple(data[f"{i} units"].tolist()),
                    float(data[f"{i} rate"]),
                    float(data[f"{i} start"]),
                    data[f"{i} values"],
                )
                for i, kind in enumerate(GROUPS)
                if f"{i} values" in data.files
            )


def _frames(path: Path, ends: Sequence[int]) -> int:
    """The number of frames that a file says that it has; ezc3d replaces it by the number that it found.

    Its header counts to 65535. In a longer file the group TRIAL has the numbers of the first frame and the last; where
    it does not, the number follows from the size, but for the rest of a block that the data do not fill.
    """
    with open_file(path, np.inf) as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(4096).lstrip(b"\0")[:20].ljust(20, b"\0")  # some begin with zeros
        file.seek(512 * (max(head[0], 1) - 1) + 3)
        order = ">" if file.read(1) == b"V" else "<"  # 86: numbers as of MIPS
    points, analogs, first, last, _, scale, begin = struct.unpack(f"{order}5HfH", head[2:18])
    if last == _MOST and len(ends) == 4:
        first, last = (low % 65536 + 65536 * (high % 65536) for low, high in (ends[:2], ends[2:]))
    elif last == _MOST:
        frame = (4 * points + analogs) * (4 if scale < 0 else 2)  # bytes
        return max(last - first + 1, (size - 512 * (begin - 1) - 511) // max(frame, 1))
    return int(last - first + 1)


def _refuse_part(read: int, promised: int) -> None:
    if read < promised and read == _MOST:
        raise DataError(f"{promised} frames or more, of which ezc3d reads {read}; cut it into parts")
    if read < promised:
        raise DataError(f"{read} frames where its header says {promised}; was it cut short?")


def group_for(groups: Sequence[Group], columns: Sequence[str]) -> Group:
    """The signals of these names, which may be in several groups; without names, the first group.

    Raises:
        DataError: if there is no signal or none of a name, or the rows of two are not at the same times.
    """
    if not groups:
        raise DataError("no signals in it")
    if not columns and (fault := groups[0].fault):
        some = ", ".join([name for group in groups for name in group.names][:3])
        raise DataError(f"its force plates cannot be read ({fault}); name what to read instead, such as {some}")
    if not columns:
        return groups[0]
    known = [name for group in groups for name in group.names]
    owner = [group for group in groups for _ in group.names]
    at = [place(known, name) for name in columns]
    times = {(owner[i].rate, owner[i].start, len(owner[i].values)) for i in at}
    if len(times) > 1:
        rates = " and ".join(f"{rate:g}" for rate in sorted({rate for rate, _, _ in times}))
        raise DataError(f"columns at {rates} Hz, which have no rows in common; ask for those of one rate")
    values = [owner[i].values[:, owner[i].names.index(known[i])] for i in at]
    units = tuple(owner[i].units[owner[i].names.index(known[i])] for i in at)
    first = owner[at[0]]
    return Group(first.kind, tuple(known[i] for i in at), units, first.rate, first.start, np.column_stack(values))
