"""Writing time series for other tools, in those formats of the shelf that are written.

A file is complete or absent.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from icmj.base.files import whole
from icmj.errors import DataError, explain_refusal
from icmj.series.formats import FORMATS
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
    path, known = Path(path), find_writers()
    if path.suffix not in known:
        raise DataError(f"{path}: cannot write {path.suffix or 'a file without a suffix'}; expected {', '.join(known)}")
    with explain_refusal(DataError, f"{path}: cannot be written"):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as part:
            known[path.suffix](series, part)


def find_writers() -> dict[str, Callable[[Series, Path], None]]:
    """What writes a file of each suffix."""
    return {suffix: one.write for one in FORMATS if hasattr(one, "write") for suffix in one.SUFFIXES}
