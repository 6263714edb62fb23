"""Reading time series from files: CSV as instruments and spreadsheets write it, Parquet, npz."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from icmj.base.array import Array
from icmj.base.npz import read_npz
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.csv_shape import csv_shape
from icmj.series.even import step_of
from icmj.series.series import Series

MOST_BYTES = 500_000_000
MOST_COLUMNS = 2000
TIMES = ("t", "time", "times", "timestamp", "seconds")
SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}

_NAME = re.compile(r"\s*(?P<name>.*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")


def read_series(path: Path | str, *, columns: Sequence[str] = (), rate: float | None = None) -> Series:
    """The time series in a file, as :func:`icmj.write_series` writes it, or as others do.

    A CSV file may be separated by commas, semicolons, tabs or blanks, the last three also with decimal commas, and may
    begin with lines that are no table; names come from the line above the first numbers, as ``ankle [rad]`` or
    ``ankle (rad)``. Columns of text are left out.

    Args:
        path: ``.parquet``, ``.npz``, anything else is taken for CSV.
        columns: signals to take, in this order; all by default.
        rate: rows per second [Hz], for a file without times.

    Raises:
        DataError: if the file cannot be read, is too large, holds no numbers or no such columns, or its times are
            missing or do not rise.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if not path.is_file():
            raise DataError("not a file")
        if size > MOST_BYTES:
            raise DataError(f"{size / 1e6:.0f} MB; expected at most {MOST_BYTES / 1e6:.0f} MB, cut it into parts")
        reader = {".parquet": _read_parquet, ".npz": _read_npz}.get(path.suffix.lower(), _read_csv)
        headers, units, data = reader(path)
        return _series(headers, units, data, columns, rate)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error, 200)
        raise DataError(f"{one_line(path, 200)}: cannot be read ({reason})") from error


def name_and_unit(header: str) -> tuple[str, str]:
    """``ankle [rad]`` and ``ankle (rad)`` are ``ankle`` in rad; without brackets the unit is "" ."""
    found = _NAME.fullmatch(one_line(header, 200))
    assert found is not None
    return found["name"], (found["unit"] or "").strip()


def _series(
    headers: Sequence[str], units: Sequence[str], data: Array, columns: Sequence[str], rate: float | None
) -> Series:
    named = [name_and_unit(header) for header in headers]
    names = [name or f"column {i + 1}" for i, (name, _) in enumerate(named)]
    units = [given or own for given, (_, own) in zip(units, named, strict=True)]
    clock = next((i for i, name in enumerate(names) if name.lower() in TIMES), None)
    if clock is None:
        if rate is None:
            raise DataError(f"no column of times ({', '.join(TIMES[:2])}); say with --rate how many rows a second has")
        t: Array = np.arange(len(data), dtype=float) * step_of(rate, 0)
    else:
        unit = units[clock].lower()
        if unit not in SECONDS:
            raise DataError(f"times in {unit!r}; expected one of {', '.join(filter(None, SECONDS))}")
        t = data[:, clock] * SECONDS[unit]
    kept = [i for i in range(len(names)) if i != clock]
    if not kept:
        raise DataError("no column of numbers beside the times")
    series = Series(t, data[:, kept], tuple(names[i] for i in kept), tuple(units[i] for i in kept))
    return series.chosen(columns) if columns else series


def _read_csv(path: Path) -> tuple[list[str], list[str], Array]:
    import pyarrow as pa
    import pyarrow.csv as pc

    text = path.read_bytes()
    shape = csv_shape(text)
    if len(shape.headers) > MOST_COLUMNS:
        raise DataError(f"{len(shape.headers)} columns; expected at most {MOST_COLUMNS}")
    text = shape.table(text)
    every = [str(i) for i in range(len(shape.headers))]
    numeric = [name for name, number in zip(every, shape.numeric, strict=True) if number]
    try:
        table = pc.read_csv(
            pa.BufferReader(text),
            pc.ReadOptions(column_names=every),
            pc.ParseOptions(delimiter=shape.delimiter),
            pc.ConvertOptions(
                column_types={name: pa.float64() for name in numeric},
                include_columns=numeric,
                null_values=["", "-", "NA", "N/A", "NaN", "nan", "null", "None"],
                decimal_point=shape.decimal,
            ),
        )
    except pa.ArrowInvalid as error:
        raise DataError(f"not a table of numbers after line {shape.first} ({one_line(error, 160)})") from error
    data = np.column_stack([table[name].to_numpy() for name in numeric])
    return [shape.headers[int(name)] for name in numeric], [""] * len(numeric), data


def _read_parquet(path: Path) -> tuple[list[str], list[str], Array]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path)
        if file.metadata.num_rows * 8 * file.metadata.num_columns > 8 * MOST_BYTES:
            raise DataError(f"{file.metadata.num_rows} rows of {file.metadata.num_columns} columns; cut it into parts")
        table = file.read()
    except (pa.ArrowException, OSError) as error:
        raise DataError(f"not a Parquet file that can be read ({one_line(error, 160)})") from error
    fields = enumerate(table.schema)  # two may have one name
    good = {i: f for i, f in fields if pa.types.is_floating(f.type) or pa.types.is_integer(f.type)}
    if not good:
        raise DataError("no column of numbers")
    units = [(f.metadata or {}).get(b"unit", b"").decode(errors="replace") for f in good.values()]
    columns = [table.column(i).to_numpy(zero_copy_only=False).astype(float) for i in good]
    return [f.name for f in good.values()], units, np.column_stack(columns)


def _read_npz(path: Path) -> tuple[list[str], list[str], Array]:
    try:
        arrays = read_npz(path, MOST_BYTES)
    except ValueError as error:
        raise DataError(str(error)) from error
    told = [arrays.pop(key, np.zeros(0, str)) for key in ("names", "units")]
    if any(texts.dtype.kind not in "US" for texts in told):
        raise DataError("names and units are not arrays of text")
    known = dict(zip(*(texts.astype(str).ravel().tolist() for texts in told), strict=False))
    vectors = {name: a for name, a in arrays.items() if a.ndim == 1 and a.dtype.kind in "fiu"}
    lengths = {len(a) for a in vectors.values()}
    if len(lengths) != 1:
        raise DataError("expected one-dimensional arrays of numbers, all of the same length")
    return (
        list(vectors),
        [str(known.get(name, "")) for name in vectors],
        np.column_stack([*vectors.values()]).astype(float),
    )
