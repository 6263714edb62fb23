"""Salvage: what can still be read of a log that was cut short."""

from __future__ import annotations

import subprocess
from pathlib import Path

from icmj.errors import LogError


def salvage(path: Path, copy: Path) -> str:
    """Copy every whole chunk of ``path`` to ``copy``; returns one sentence on what was saved.

    rerun's own merge does it, in a process of its own: a damaged file can abort the reader.

    Raises:
        LogError: if nothing can be saved.
    """
    from icmj.log.replay import viewer

    command = [str(viewer()), "rrd", "merge", "--continue-on-error", "-o", str(copy), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    kept = copy.stat().st_size if copy.is_file() else 0
    if done.returncode != 0 or not _holds_data(copy):
        raise LogError(f"{path}: not a rerun recording, or cut so short that nothing of it can be saved; write it anew")
    return (
        f"{path}: incomplete; salvaged {kept / 1e6:.2f} MB of {path.stat().st_size / 1e6:.2f} MB, what follows is lost"
    )


def _holds_data(copy: Path) -> bool:
    from rerun.chunk import RrdReader

    try:
        return len(RrdReader(copy).store()) > 0
    except Exception:  # rerun's bindings raise what their Rust side fails with, of several types
        return False
