"""Which run files a study is of: files, folders, shipped cases by name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from icmj.errors import RunFileError
from icmj.runfile.reading import load_run
from icmj.runfile.schema import RunFile, overridden
from icmj.work.shipped import RUNS

HERE = Path("runs")


def find_runs(paths: Sequence[Path], changes: Sequence[str] = (), *, allow_code: bool = False) -> tuple[RunFile, ...]:
    """Load run files; a folder stands for all ``*.toml`` in it, a bare name for a shipped case.

    Args:
        paths: files, folders and names; none stand for the folder ``runs``, or for all shipped cases where it has none.
        changes: ``KEY=VALUE`` in each of them; see :func:`icmj.runfile.schema.overridden`.
        allow_code: whether Python code that they name may be run.

    Raises:
        RunFileError: if there is none, one is not valid, or two have the same case name.
    """
    files: list[Path] = []
    for path in paths or [HERE if any(HERE.glob("*.toml")) else RUNS.folder]:
        found = sorted(path.glob("*.toml")) if path.is_dir() else [path]
        if not found:
            raise RunFileError(f"{path}: no run file (*.toml) in this folder")
        files += found
    runs = tuple(overridden(load_run(file, allow_code=allow_code), changes) for file in files)
    seen: dict[str, Path] = {}
    for run in runs:
        if run.case.name in seen:
            raise RunFileError(f"{run.path}: case.name {run.case.name!r} is taken by {seen[run.case.name]}; rename one")
        seen[run.case.name] = run.path
    return runs
