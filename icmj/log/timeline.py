"""The one timeline of a log: seconds from the start of the run, as rerun's time."""

from __future__ import annotations

import numpy as np
import rerun as rr

from icmj.base.array import Array

TIMELINE = "time"


def time_column(t: Array) -> rr.TimeColumn:
    """Seconds as rerun's time, to the nearest nanosecond (the archive keeps them exactly)."""
    nanoseconds = np.rint(np.asarray(t) * 1e9).astype(np.int64)
    return rr.TimeColumn(TIMELINE, duration=nanoseconds.astype("timedelta64[ns]"))
