"""The files of a run file that its log stores, so that the log can be analysed where these files do not exist."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from icmj.engine.soundness import files_of
from icmj.errors import IcmjError
from icmj.runfile.kept import MOST_BYTES, Kept
from icmj.runfile.schema import RunFile
from icmj.runfile.setpoint_tables import followed_files


def kept_of(run: RunFile) -> Kept:
    """The files of a run file: as they are on disk, else as the log had them that it was read from; or none."""
    home = run.path.absolute()
    try:
        paths = [path.absolute() for path in (run.assumed_path, run.actual_path)]
        files = dict.fromkeys(found.resolve() for path in dict.fromkeys(paths) for found in _files(path))
        files |= dict.fromkeys(path.resolve() for path in followed_files(run.setpoint, home))
        if not files or sum(path.stat().st_size for path in files) > MOST_BYTES:
            return run.kept
        root = Path(os.path.commonpath([home.parent, *(path.parent for path in files)]))
        contents = {path.relative_to(root).as_posix(): path.read_bytes() for path in files}
    except (OSError, ValueError, IcmjError):
        return run.kept
    named = (run.assumed.model or run.assumed.matrices, run.actual.model or run.actual.matrices)
    absolute = [
        path.relative_to(root).as_posix() if name and Path(name).is_absolute() else ""
        for name, path in zip(named, paths, strict=True)
    ]
    return Kept(home.relative_to(root).as_posix(), contents, *absolute)


def _files(path: Path) -> Iterator[Path]:
    """A plant's file with all that it refers to; a run file that holds its own matrices is in the log anyway."""
    if path.suffix in (".npz", ".json"):
        yield path
    elif path.suffix != ".toml":
        yield from files_of(path)
