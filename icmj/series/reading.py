"""Reading time series from files: CSV as instruments and spreadsheets write it, Parquet, npz, OpenSim's, C3D."""

from __future__ import annotations

import codecs
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from icmj.base.array import Array, each_npz, npz_headers, read_npz, refuse_fatal
from icmj.base.files import open_file
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.c3d import group_for, groups_of
from icmj.series.columns import MOST_NUMBERS, choose_columns
from icmj.series.csv_table import HEAD, LONGEST_LINE, TableForm, find_form, missing_words
from icmj.series.opensim import LINES, header_of
from icmj.series.series import SETTLED, Series, see_names_differ

if TYPE_CHECKING:
    import pyarrow as pa

MOST_BYTES = 500_000_000
MOST_COLUMNS = 2000

MOST_LINE = 1_000_000  # bytes
_PART = 8_000_000  # bytes of a file that are looked at together
_ROWS = 100_000  # rows read at a time
_MOST_WORDS = 10_000_000  # bytes of names and units
_TEXT = "which is text"


def read_series(
    path: Path | str,
    *,
    columns: Sequence[str] = (),
    rate: float | None = None,
    since: float | None = None,
    until: float | None = None,
) -> Series:
    """The time series in a file that :func:`icmj.write_series` or another program has written.

    The form of a CSV file is that in which most cells are numbers (:mod:`icmj.series.csv_table`): its separators,
    decimal sign, and the lines before the table. Names are read from above the first numbers, such as ``ankle [rad]``
    or ``ankle (rad)``, or with a row of units below them. Columns of text, of further times and of row numbers are left
    out, which the fact ``left out`` says. For files of OpenSim (``.mot``, ``.sto``), units follow from the header and
    from conventional names of columns. A C3D file has signals of four kinds: centres of pressure (``plate1.cop.x``) and
    forces (``plate1.force.z``) of force plates, points (``C7.x``), and analog channels by their labels; by default the
    first kind that it contains is read. Signals that are read together must have the same rate.

    Where the vertical force of a plate is among the columns of a table (``Fz``, ``plate1.force.z``), a centre of
    pressure is missing in rows in which it is below 20 N, as in a C3D file.

    Only the requested columns are read, and such forces; their size is checked before, from headers or the number of
    lines.

    Args:
        path: ``.parquet``, ``.npz``, ``.mot``, ``.sto``, ``.c3d``; any other file is read as CSV.
        columns: names of the signals, in this order; by default all.
        rate: rows per second [Hz], for a file without times, or with times whose unit nothing says.
        since, until: times [s] before and after which rows are left out; by default none.

    Raises:
        DataError: if the file cannot be read, is too large, contains no numbers or no such columns, has no rows from
            ``since`` to ``until``, its times are missing, do not increase or have a unit that has to be said, or it can
            be read in two ways; for C3D, if ezc3d is not installed.
    """
    path = Path(path)
    try:
        if (advice := ELSEWHERE.get(path.suffix.lower())) is not None:
            raise DataError(f"not a format that icmj reads; {advice}")
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
    if (mark := file.read(2)) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        file = io.BytesIO((mark + file.read()).decode("utf-16", errors="replace").encode())
    file.seek(0)
    form = find_form(b"".join(islice(iter(lambda: file.readline(LONGEST_LINE + 1), b""), HEAD)))
    if len(form.headers) > MOST_COLUMNS:
        raise DataError(f"{len(form.headers)} columns; expected at most {MOST_COLUMNS}")
    numeric = [i for i, number in enumerate(form.numeric) if number]
    left = [
        f"{header}, {_TEXT}" for header, number in zip(form.headers, form.numeric, strict=True) if not number and header
    ]
    for i, words in form.faults.items():
        if not form.numeric[i] and not columns:
            name = form.headers[i] or f"column {i + 1}"
            raise DataError(f"{name}: {words!r} is no number; write the unit in the name")
    choice = choose_columns(
        [form.headers[i] for i in numeric], [form.units[i] for i in numeric], columns, rate, left,
        {numeric.index(i): words for i, words in form.faults.items() if i in numeric},
    )  # fmt: skip
    chosen = [str(numeric[i]) for i in choice.at]
    file.seek(form.offset)
    ends = [(text.count(b"\n"), text.count(b"\r")) for text in iter(lambda: file.read(_PART), b"")]
    # a blank line ends, too; rows may be fewer, not more
    data = choice.room(max(map(sum, zip(*ends, strict=True)), default=0) + 1)
    file.seek(form.offset)
    count = 0
    for text in _parts(file):
        rows = _numbers(text, form, chosen)
        if count + len(rows) > len(data):  # lines ended in both ways
            raise DataError("mixed line endings; save the file with one kind of line ending")
        data[count : count + len(rows)] = rows
        count += len(rows)
    return choice.to_series(data[:count])


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


def _numbers(text: bytes, form: TableForm, chosen: Sequence[str]) -> Array:
    import pyarrow as pa
    import pyarrow.csv as pc

    if not text.strip():
        return np.empty((0, len(chosen)))
    text = form.clean(text)
    try:
        table = pc.read_csv(
            pa.BufferReader(text),
            # by one thread: one that is still at work when the interpreter is taken down may abort it
            pc.ReadOptions(
                column_names=[str(i) for i in range(len(form.headers))], use_threads=False, block_size=len(text) + 1
            ),
            pc.ParseOptions(delimiter=form.delimiter),
            pc.ConvertOptions(
                column_types=dict.fromkeys(chosen, pa.float64()),
                include_columns=list(dict.fromkeys(chosen)),
                null_values=missing_words(),
                decimal_point=form.decimal,
            ),
        )
    except pa.ArrowInvalid as error:
        raise DataError(f"not a table of numbers after line {form.first} ({one_line(error, 160)})") from error
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
            good = [i for i, f in enumerate(every) if _holds_numbers(f.type)]
            left = [f"{f.name}, which is of type {f.type}" for i, f in enumerate(every) if i not in good]
            fields = [every[i] for i in good]
            if not fields:
                raise DataError("no column of numbers")
            units = [(f.metadata or {}).get(b"unit", b"").decode(errors="replace") for f in fields]
            units = ["s" if pa.types.is_temporal(f.type) else unit for f, unit in zip(fields, units, strict=True)]
            choice = choose_columns([f.name for f in fields], units, columns, rate, left)
            names = [f.name for f in every]  # two may have one name
            chosen = [(names[good[i]], names[: good[i]].count(names[good[i]])) for i in choice.at]
            data, count = choice.room(file.metadata.num_rows), 0
            for batch in file.iter_batches(_ROWS, columns=list({name for name, _ in chosen}), use_threads=False):
                for i, (name, which) in enumerate(chosen):
                    column = batch.column(batch.schema.get_all_field_indices(name)[which])
                    data[count : count + len(batch), i] = _to_numbers(column)
                count += len(batch)
    except (pa.ArrowException, OSError, IndexError) as error:
        raise DataError(f"not a Parquet file that can be read ({one_line(error, 160)})") from error
    series = choice.to_series(data[:count])
    return replace(series, facts={**series.facts, SETTLED: ""}) if settled else series


def _holds_numbers(kind: pa.DataType) -> bool:
    import pyarrow.types as kinds

    return bool(
        kinds.is_floating(kind) or kinds.is_integer(kind) or kinds.is_decimal(kind) or kinds.is_timestamp(kind)
        or kinds.is_duration(kind)
    )  # fmt: skip


def _to_numbers(column: pa.Array) -> Array:
    """Numbers; of times and durations those of seconds."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        return _to_numbers(column.cast(pa.int64())) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
    if pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=float)


def _read_npz(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> Series:
    try:
        headers = npz_headers(path)
        told = read_npz(path, _MOST_WORDS, ("names", "units")) if "names" in headers else {}
        if any(texts.dtype.kind not in "US" for texts in told.values()):
            raise DataError("names and units are not arrays of text")
        kept = {name: one for name, one in headers.items() if name not in ("names", "units", "facts")}
        shapes = {name: shape for name, (shape, kind) in kept.items() if kind.kind in "fiu" and shape}
        several = [name for name, shape in shapes.items() if len(shape) == 2 and shape[1] > 1]
        if several:
            raise DataError(f"{several[0]} has shape {shapes[several[0]]}; save each column under a name of its own")
        vectors = [name for name, shape in shapes.items() if shape[1:] in ((), (1,))]
        left = [f"{name}, which is no vector of numbers" for name in kept if name not in vectors]
        lengths = {headers[name][0][0] for name in vectors}
        if len(lengths) != 1:
            raise DataError("expected one-dimensional arrays of numbers, all of the same length")
        names, texts = (told.get(key, np.zeros(0, str)).astype(str).ravel().tolist() for key in ("names", "units"))
        known = dict(zip(names, texts, strict=False))
        choice = choose_columns(vectors, [known.get(name, "") for name in vectors], columns, rate, left)
        data = choice.room(lengths.pop())
        chosen = [vectors[i] for i in choice.at]
        for name, values in each_npz(path, 8 * MOST_NUMBERS * 2, chosen):
            data[:, [i for i, other in enumerate(chosen) if other == name]] = values.reshape(-1, 1)
    except DataError:
        raise
    except ValueError as error:
        raise DataError(str(error)) from error
    return choice.to_series(data)


READERS: dict[str, Callable[[Path, BinaryIO, Sequence[str], float | None], Series]] = {
    ".parquet": _read_parquet,
    ".npz": _read_npz,
    ".mot": _read_opensim,
    ".sto": _read_opensim,
    ".c3d": _read_c3d,
}

_TABLE = "save its table as CSV, with names and units in the first row"
ELSEWHERE = {
    **dict.fromkeys((".xlsx", ".xls", ".ods"), _TABLE),
    **dict.fromkeys(
        (".mat", ".h5", ".hdf5"), "save its arrays as npz (numpy.savez) or CSV, one column for each signal"
    ),
    **dict.fromkeys((".trc", ".anc", ".tdf", ".qtm"), "export it as C3D or as a table"),
    **dict.fromkeys((".zip", ".gz", ".7z"), "unpack it first"),
}
"""What to do with files of other formats, by suffix."""
