"""The rerun log of one simulation: written whole, read back bit-exact, replayed. Only this package imports rerun."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from icmj.result import Result


def write_log(result: Result, path: Path | str) -> None:
    """Write ``result`` to ``path``; see :func:`icmj.log.writer.write_log`."""
    from icmj.log.writer import write_log  # rerun takes 0.4 s to import

    write_log(result, path)


def read_log(path: Path | str) -> Result:
    """Read a log; see :func:`icmj.log.reader.read_log`."""
    from icmj.log.reader import read_log

    return read_log(path)


def read_summary(path: Path | str) -> dict[str, dict[str, Any]]:
    """The properties of a log by section; see :func:`icmj.log.reader.read_summary`."""
    from icmj.log.reader import read_summary

    return read_summary(path)


__all__ = ["read_log", "read_summary", "write_log"]
