"""The target of rerun's output: memory, which this process then writes to the disk; and the columns of times in it.

rerun's own writer says nothing of a full disk, and once in some hundred times it waits for ever there.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rerun as rr

from icmj.base.array import Array

_OPEN = Path("/proc/self/fd")  # files that a process has open, by name
TIMELINE = "time"


@contextmanager
def in_memory(part: Path) -> Iterator[Path]:
    """A path for rerun to write to, the content of which is in ``part`` when the block ends well.

    Where the system has no files in memory it is ``part`` itself.

    Raises:
        OSError: if it cannot be written.
    """
    if not hasattr(os, "memfd_create") or not _OPEN.is_dir():
        yield part
        return
    with os.fdopen(os.memfd_create("icmj-log"), "rb") as memory:
        yield _OPEN / str(memory.fileno())
        if memory.seek(0, os.SEEK_END) == 0:  # rerun is switched off
            return
        memory.seek(0)
        with part.open("wb") as file:
            shutil.copyfileobj(memory, file, 1 << 22)


def time_column(t: Array) -> rr.TimeColumn:
    """Seconds as rerun's time, to the nearest nanosecond (the archive keeps them exactly)."""
    nanoseconds = np.rint(np.asarray(t) * 1e9).astype(np.int64)
    return rr.TimeColumn(TIMELINE, duration=nanoseconds.astype("timedelta64[ns]"))
