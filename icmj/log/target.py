"""The target of rerun's output: memory, which this process then writes to the disk.

rerun's own writer says nothing of a full disk, and once in some hundred times it waits for ever there.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_OPEN = Path("/proc/self/fd")  # files that a process has open, by name


@contextmanager
def write_in_memory(part: Path) -> Iterator[Path]:
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
