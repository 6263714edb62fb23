"""Reading and writing time series.

Reading time series from files: CSV as instruments and spreadsheets write it, Parquet, npz, OpenSim's, C3D.

Writing time series for other tools: CSV, Parquet, npz; a file is either complete or absent.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from icmj.base.array import Array, each_npz, npz_headers, read_npz, refuse_fatal
from icmj.base.files import open_file, whole
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.formats import HEAD, LINES, LONGEST_LINE, CsvShape, csv_shape, group_for, groups_of, header_of
from icmj.series.plates import leave_out_unloaded, loads_of
from icmj.series.series import COUNTER, SETTLED, Series, place, see_names_differ, step_of

MOST_BYTES = 500_000_000
MOST_NUMBERS = 12_000_000  # that are read, times among them; measuring them takes a gigabyte and a half
MOST_COLUMNS = 2000
TIMES = ("t", "time", "times", "timestamp", "seconds")
TRIALS = ("trial", "trials", "repetition")  # columns that count what stands one below the other
SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}

MOST_LINE = 1_000_000  # bytes
_PART = 8_000_000  # bytes of a file that are looked at together
_ROWS = 100_000  # rows read at a time
_MOST_WORDS = 10_000_000  # bytes of names and units

_NAME = re.compile(r"\s*(?P<name>.*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")


def read_series(
    path: Path | str,
    *,
    columns: Sequence[str] = (),
    rate: float | None = None,
    since: float | None = None,
    until: float | None = None,
) -> Series:
    """The time series in a file that :func:`icmj.write_series` or another program has written.

    The columns of a CSV file may be separated by commas, semicolons, tabs or spaces; unless commas separate them,
    numbers may have decimal commas. The file may begin with lines that are not part of the table. Names are read from
    the line above the first numbers, such as ``ankle [rad]`` or ``ankle (rad)``. Columns of text are left out. For
    files of OpenSim (``.mot``, ``.sto``), units follow from the header and from conventional names of columns. A C3D
    file has signals of four kinds: centres of pressure (``plate1.cop.x``) and forces (``plate1.force.z``) of force
    plates, points (``C7.x``), and analog channels by their labels; by default the first kind that it contains is read.
    Signals that are read together must have the same rate.

    Where the vertical force of a plate is among the columns of a table (``Fz``, ``plate1.force.z``), a centre of
    pressure is missing in rows in which it is below 20 N, as in a C3D file.

    Only the requested columns are read, and such forces; their size is checked before, from headers or the number of
    lines.

    Args:
        path: ``.parquet``, ``.npz``, ``.mot``, ``.sto``, ``.c3d``; any other file is read as CSV.
        columns: names of the signals, in this order; by default all.
        rate: rows per second [Hz], for a file without times.
        since, until: times [s] before and after which rows are left out; by default none.

    Raises:
        DataError: if the file cannot be read, is too large, contains no numbers or no such columns, has no rows from
            ``since`` to ``until``, or its times are missing or do not increase; for C3D, if ezc3d is not installed.
    """
    path = Path(path)
    try:
        with open_file(path, MOST_BYTES) as file:
            found = READERS.get(path.suffix.lower(), _read_csv)(path, file, columns, rate)
            return cut_rows(found, since, until)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error, 200)
        raise DataError(f"{one_line(path, 200)}: cannot be read ({reason})") from error


def cut_rows(series: Series, since: float | None, until: float | None) -> Series:
    """The rows from ``since`` to ``until`` [s], where they are given.

    Raises:
        DataError: if there are none.
    """
    kept = series if since is None else series.since(since)
    kept = kept if until is None else kept.until(until)
    if len(series) and not len(kept):
        begin, end = (f"{given:g}" if given is not None else "" for given in (since, until))
        asked = " ".join(filter(None, (begin and f"from {begin} s", end and f"until {end} s")))
        raise DataError(f"no rows {asked}; it has rows from {series.t[0]:g} to {series.t[-1]:g} s")
    return kept


def name_and_unit(header: str) -> tuple[str, str]:
    """``ankle [rad]`` and ``ankle (rad)`` are ``ankle`` in rad; without brackets the unit is "" ."""
    found = _NAME.fullmatch(one_line(header, 200))
    assert found is not None
    return found["name"], (found["unit"] or "").strip()


@dataclass(frozen=True)
class _Choice:
    """The columns of a file that are read: that of the times, if there is one, before the signals in their order.

    Attributes:
        at: their places in the file.
        names, units: of the signals.
        second: what the times are in [s]; ``None`` where there are no times.
        step: between rows without times [s].
        beside: names and units of what is read behind the signals: the number of events before each row of a run, and
            vertical forces of plates.
        loads: names of the vertical forces of each centre of pressure.
    """

    at: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    second: float | None
    step: float
    beside: tuple[tuple[str, str], ...] = ()
    loads: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, headers: Sequence[str], units: Sequence[str], columns: Sequence[str], rate: float | None) -> _Choice:
        """The columns to read of a file with these, some of which are asked for, or all."""
        named = [name_and_unit(header) for header in headers]
        names = [name or f"column {i + 1}" for i, (name, _) in enumerate(named)]
        units = [given or own for given, (_, own) in zip(units, named, strict=True)]
        clock = next((i for i, name in enumerate(names) if name.lower() in TIMES), None)
        second, step = None, 0.0
        if clock is not None:
            unit = units[clock].lower()
            if unit not in SECONDS:
                raise DataError(f"times in {unit!r}; expected one of {', '.join(filter(None, SECONDS))}")
            second = SECONDS[unit]
        elif rate is None:
            raise DataError(f"no column of times ({', '.join(TIMES[:2])}); say with --rate how many rows a second has")
        else:
            step = step_of(rate, 0)
        kept = [i for i in range(len(names)) if i != clock]
        if not kept:
            raise DataError("no column of numbers beside the times")
        known = [names[i] for i in kept]
        see_names_differ(known)
        needed = [i for i in kept if names[i] == COUNTER and not units[i]]
        loads = {kept[i]: [kept[at] for at in on] for i, on in loads_of(known, [units[i] for i in kept]).items()}
        if columns:
            kept = [kept[place(known, name)] for name in columns]
        loads = {i: on for i, on in loads.items() if i in kept}
        needed += [i for on in loads.values() for i in on]
        needed += [i for i, name in enumerate(names) if clock is None and name.lower() in TRIALS]
        beside = list(dict.fromkeys(i for i in needed if i not in kept))
        at = (*([] if clock is None else [clock]), *kept, *beside)
        told = [tuple(of[i] for i in kept) for of in (names, units)]
        of_plates = {names[i]: tuple(names[each] for each in on) for i, on in loads.items()}
        return cls(at, told[0], told[1], second, step, tuple((names[i], units[i]) for i in beside), of_plates)

    def room(self, rows: int) -> Array:
        """An array for this number of rows.

        Raises:
            DataError: if they are more than can be read.
        """
        if rows * len(self.at) > MOST_NUMBERS:
            raise DataError(
                f"about {rows} rows of {len(self.at)} columns; expected at most {MOST_NUMBERS / 1e6:g} million "
                "numbers, name columns or cut it into parts"
            )
        return np.empty((rows, len(self.at)))

    def series(self, data: Array) -> Series:
        """The series from the data that were read."""
        t = np.arange(len(data), dtype=float) * self.step
        if self.second is not None:
            t, data = data[:, 0] * self.second, data[:, 1:]
        names, units = zip(*zip(self.names, self.units, strict=True), *self.beside, strict=True)
        for at in (i for i, name in enumerate(names) if self.second is None and name.lower() in TRIALS):
            if len(data) and np.ptp(data[:, at]) > 0:
                raise DataError(
                    f"trials one below the other, which the column {names[at]!r} counts; save each in a file of its own"
                )
        whole = Series(t, data, names, units)
        return leave_out_unloaded(whole, self.loads).chosen(self.names)


def _read_opensim(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> Series:
    header = header_of(islice(iter(lambda: file.readline(LONGEST_LINE + 1), b""), LINES + 1))
    file.seek(0)
    series = _read_csv(path, file, columns, rate)
    if header.rows is not None and header.rows != len(series):
        raise DataError(f"{len(series)} rows where its header says {header.rows}; was it cut short?")
    return replace(series, units=tuple(map(header.unit_of, series.names)))


def _read_c3d(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> Series:
    group = group_for(groups_of(path), columns)
    see_names_differ(group.names)
    if group.values.size > MOST_NUMBERS:
        raise DataError(f"{group.values.size} numbers; expected at most {MOST_NUMBERS / 1e6:g} million")
    t = group.start + np.arange(len(group.values)) / group.rate
    return Series(t, group.values, group.names, group.units)


def _read_csv(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> Series:
    shape = csv_shape(b"".join(islice(iter(lambda: file.readline(LONGEST_LINE + 1), b""), HEAD)))
    if len(shape.headers) > MOST_COLUMNS:
        raise DataError(f"{len(shape.headers)} columns; expected at most {MOST_COLUMNS}")
    numeric = [i for i, number in enumerate(shape.numeric) if number]
    choice = _Choice.of([shape.headers[i] for i in numeric], [""] * len(numeric), columns, rate)
    chosen = [str(numeric[i]) for i in choice.at]
    file.seek(shape.offset)
    ends = [(text.count(b"\n"), text.count(b"\r")) for text in iter(lambda: file.read(_PART), b"")]
    # a blank line ends, too; rows may be fewer, not more
    data = choice.room(max(map(sum, zip(*ends, strict=True)), default=0) + 1)
    file.seek(shape.offset)
    count = 0
    for text in _parts(file):
        rows = _numbers(text, shape, chosen)
        if count + len(rows) > len(data):  # lines ended in both ways
            raise DataError("mixed line endings; save the file with one kind of line ending")
        data[count : count + len(rows)] = rows
        count += len(rows)
    return choice.series(data[:count])


def _parts(file: BinaryIO) -> Iterator[bytes]:
    """The rest of a file, in parts that end with complete lines."""
    rest = b""
    while text := file.read(_PART):
        text = rest + text
        end = max(text.rfind(b"\n"), text.rfind(b"\r", 0, -1)) + 1
        if len(text) - end > MOST_LINE:
            raise DataError(f"a line of more than {MOST_LINE} characters; expected a table")
        rest = text[end:]
        yield text[:end]
    yield rest


def _numbers(text: bytes, shape: CsvShape, chosen: Sequence[str]) -> Array:
    import pyarrow as pa
    import pyarrow.csv as pc

    if not text.strip():
        return np.empty((0, len(chosen)))
    text = shape.table(text)
    try:
        table = pc.read_csv(
            pa.BufferReader(text),
            # by one thread: one that is still at work when the interpreter is taken down may abort it
            pc.ReadOptions(
                column_names=[str(i) for i in range(len(shape.headers))], use_threads=False, block_size=len(text) + 1
            ),
            pc.ParseOptions(delimiter=shape.delimiter),
            pc.ConvertOptions(
                column_types=dict.fromkeys(chosen, pa.float64()),
                include_columns=list(dict.fromkeys(chosen)),
                null_values=["", "-", "NA", "N/A", "NaN", "nan", "null", "None"],
                decimal_point=shape.decimal,
            ),
        )
    except pa.ArrowInvalid as error:
        raise DataError(f"not a table of numbers after line {shape.first} ({one_line(error, 160)})") from error
    return np.column_stack([table[name].to_numpy() for name in chosen])


def _read_parquet(path: Path, source: BinaryIO, columns: Sequence[str], rate: float | None) -> Series:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        refuse_fatal(path)
    except ValueError as error:
        raise DataError(f"not a Parquet file that can be read ({error})") from error
    try:
        with pq.ParquetFile(source, pre_buffer=False, buffer_size=_PART) as file:
            every = list(file.schema_arrow)
            settled = f"icmj.{SETTLED}".encode() in (file.schema_arrow.metadata or {})
            good = [i for i, f in enumerate(every) if pa.types.is_floating(f.type) or pa.types.is_integer(f.type)]
            fields = [every[i] for i in good]
            if not fields:
                raise DataError("no column of numbers")
            units = [(f.metadata or {}).get(b"unit", b"").decode(errors="replace") for f in fields]
            choice = _Choice.of([f.name for f in fields], units, columns, rate)
            names = [f.name for f in every]  # two may have one name
            chosen = [(names[good[i]], names[: good[i]].count(names[good[i]])) for i in choice.at]
            data, count = choice.room(file.metadata.num_rows), 0
            for batch in file.iter_batches(_ROWS, columns=list({name for name, _ in chosen}), use_threads=False):
                for i, (name, which) in enumerate(chosen):
                    column = batch.column(batch.schema.get_all_field_indices(name)[which])
                    data[count : count + len(batch), i] = column.to_numpy(zero_copy_only=False)
                count += len(batch)
    except (pa.ArrowException, OSError, IndexError) as error:
        raise DataError(f"not a Parquet file that can be read ({one_line(error, 160)})") from error
    series = choice.series(data[:count])
    return replace(series, facts={**series.facts, SETTLED: ""}) if settled else series


def _read_npz(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> Series:
    try:
        headers = npz_headers(path)
        told = read_npz(path, _MOST_WORDS, ("names", "units")) if "names" in headers else {}
        if any(texts.dtype.kind not in "US" for texts in told.values()):
            raise DataError("names and units are not arrays of text")
        vectors = [name for name, (shape, kind) in headers.items() if len(shape) == 1 and kind.kind in "fiu"]
        lengths = {headers[name][0][0] for name in vectors}
        if len(lengths) != 1:
            raise DataError("expected one-dimensional arrays of numbers, all of the same length")
        names, texts = (told.get(key, np.zeros(0, str)).astype(str).ravel().tolist() for key in ("names", "units"))
        known = dict(zip(names, texts, strict=False))
        choice = _Choice.of(vectors, [known.get(name, "") for name in vectors], columns, rate)
        data = choice.room(lengths.pop())
        chosen = [vectors[i] for i in choice.at]
        for name, values in each_npz(path, 8 * MOST_NUMBERS * 2, chosen):
            data[:, [i for i, other in enumerate(chosen) if other == name]] = values[:, None]
    except DataError:
        raise
    except ValueError as error:
        raise DataError(str(error)) from error
    return choice.series(data)


READERS: dict[str, Callable[[Path, BinaryIO, Sequence[str], float | None], Series]] = {
    ".parquet": _read_parquet,
    ".npz": _read_npz,
    ".mot": _read_opensim,
    ".sto": _read_opensim,
    ".c3d": _read_c3d,
}


def write_series(series: Series, path: Path | str) -> None:
    """Write ``series`` to a file whose suffix determines the format.

    ============  ===================================================================================================
    ``.csv``      a header such as ``t [s],ankle [rad]``, then numbers that are restored bit for bit; UTF-8
    ``.parquet``  columns ``t``, ``ankle``; the ``unit`` in the metadata of each field, the facts in that of the schema
    ``.npz``      arrays ``t``, ``ankle``; ``names`` and ``units`` (including those of ``t``), ``facts`` as JSON text
    ============  ===================================================================================================

    Raises:
        DataError: if the suffix is not one of these, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in FORMATS:
        raise DataError(
            f"{path}: cannot write {path.suffix or 'a file without a suffix'}; expected {', '.join(FORMATS)}"
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as part:
            FORMATS[path.suffix](series, part)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error


def _write_csv(series: Series, part: Path) -> None:
    import pyarrow as pa
    import pyarrow.csv as pc

    columns = (series.t, *series.values.T)
    table = pa.table([pa.array(column) for column in columns], names=[str(i) for i in range(len(columns))])
    with open(part, "wb") as file:
        file.write((",".join(_quote(name) for name in series.headers) + "\n").encode())
        pc.write_csv(table, file, pc.WriteOptions(include_header=False, quoting_style="none"))


def _quote(name: str) -> str:
    name = " ".join(name.split())
    return '"' + name.replace('"', '""') + '"' if "," in name or '"' in name else name


def _write_parquet(series: Series, part: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [
        pa.field(name, pa.float64(), metadata={"unit": unit})
        for name, unit in zip(("t", *series.names), ("s", *series.units), strict=True)
    ]
    schema = pa.schema(fields, metadata={f"icmj.{key}": value for key, value in series.facts.items()})
    pq.write_table(pa.table([pa.array(column) for column in (series.t, *series.values.T)], schema=schema), part)


def _write_npz(series: Series, part: Path) -> None:
    arrays = {"t": series.t, **{name: series.values[:, i] for i, name in enumerate(series.names)}}
    own = sorted({"t", "names", "units", "facts"} & set(series.names))
    if own:
        raise DataError(f"the name {own[0]!r} is reserved in npz files; rename the signal")
    facts = {
        "names": np.array(["t", *series.names]),
        "units": np.array(["s", *series.units]),
        "facts": np.array(json.dumps(dict(series.facts), ensure_ascii=False)),
    }
    with open(part, "wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays, **facts)


FORMATS: dict[str, Callable[[Series, Path], None]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".npz": _write_npz,
}
"""What writes a file of each suffix."""
