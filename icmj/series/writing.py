"""Writing time series for other tools: CSV, Parquet, npz; a file is either complete or absent."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from icmj.base.files import whole
from icmj.errors import DataError
from icmj.series.series import Series


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
