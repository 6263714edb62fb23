"""Times of the day as text, such as ``2026-03-04T09:30:00.125`` or ``9:30:00,125``, in seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import Array

if TYPE_CHECKING:
    import pyarrow as pa

_DAY = 86400.0  # s
_FORM = (
    r"^\s*(?:\d{4}-\d{2}-\d{2}|\d{1,2}[./]\d{1,2}[./]\d{4})?[T ]?(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}(?:[.,]\d+)?)"
    r"(?:Z|[+-]\d{2}:?\d{2})?\s*$"
)
_TIME = re.compile(_FORM)


def are_times(cells: Sequence[str]) -> bool:
    """Whether each is a time of the day, later than the one before: whole seconds of many rows are no times of rows."""
    found = [_TIME.match(cell) for cell in cells]
    times = [3600 * int(of["h"]) + 60 * int(of["m"]) + float(of["s"].replace(",", ".")) for of in found if of]
    return len(times) == len(cells) > 1 and all(
        (later - t) % _DAY < _DAY / 2 and later != t for t, later in pairwise(times)
    )


def read_times(cells: pa.ChunkedArray) -> Array:
    """Seconds since midnight, shape (N,); NaN where there is no time of the day. The day is not looked at."""
    import pyarrow as pa
    import pyarrow.compute as pc

    parts = pc.extract_regex(cells, _FORM)
    words = (pc.replace_substring(pc.struct_field(parts, of), ",", ".") for of in ("h", "m", "s"))
    hours, minutes, seconds = (pc.cast(each, pa.float64()).to_numpy() for each in words)
    t: Array = 3600 * hours + 60 * minutes + seconds
    return t


def count_from_first(t: Array) -> Array:
    """Times since the first [s], from those of the day: one more than half a day earlier is of the next."""
    return t - t[:1] + _DAY * np.cumsum(np.diff(t, prepend=t[:1]) < -_DAY / 2)
