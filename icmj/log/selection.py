"""Which logs are meant where files, folders or cases are named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from icmj.base.files import is_file_name
from icmj.base.similar_names import suggest
from icmj.base.text import one_line
from icmj.case.case import PlantKind
from icmj.errors import LogError
from icmj.log.reader import DamagedLog, read_summary
from icmj.work.shipped import RUNS


def is_log(path: Path) -> bool:
    """Whether a file is a log of icmj, or may have been one before it was damaged."""
    try:
        return "run_file" in read_summary(path)
    except LogError as error:
        return isinstance(error, DamagedLog)


def find_logs(paths: Sequence[Path], results: Path) -> list[Path]:
    """The files that are meant where logs are named, each once: what every command asks.

    A folder means the logs in it, but no recording of a branch. A name of which there is no file means the logs of the
    case of this name in the folder ``results``, on one plant or both. Any other path means itself, there or not.

    Raises:
        LogError: if a folder has no log, or there is neither a file nor a case of a name.
    """
    found: dict[Path, None] = {}
    for path in paths:
        found |= dict.fromkeys(_logs_of(path, results))
    return list(found)


def find_log(path: Path, results: Path) -> Path:
    """The one file that is meant by :func:`find_logs`; of a case on both plants, its log in MuJoCo.

    Raises:
        LogError: as :func:`find_logs`, or if several are meant.
    """
    found = find_logs([path], results)
    if len(found) > 1 and path.is_dir():
        names = ", ".join(log.stem for log in found[:3]) + (", …" if len(found) > 3 else "")
        raise LogError(f"{path}: {len(found)} logs ({names}), where one is needed; give the file of one")
    return found[-1]


def _logs_of(path: Path, results: Path) -> list[Path]:
    if path.is_dir():
        if not (found := [log for log in sorted(path.glob("*.rrd")) if is_log(log)]):
            raise LogError(f"{path}: no such log; the folder has none; icmj run and icmj study write some")
        return found
    if len(path.parts) != 1 or is_file_name(path) or path.exists():
        return [path]
    plants = get_args(PlantKind)
    named = [results / f"{path}{end}.rrd" for end in ("", *(f".{plant}" for plant in plants))]
    if found := [log for log in named if log.is_file()]:
        return found
    cases = {log.stem.removesuffix(f".{plant}") for log in results.glob("*.rrd") for plant in plants}
    writes = f"icmj run {path} writes one" if path.name in RUNS.files else "icmj run and icmj study write some there"
    near = suggest(str(path), sorted(cases)) or f"; {writes}"
    raise LogError(f"{one_line(path, 80)}: no such log, nor one of a case of this name in {results}{near}")
