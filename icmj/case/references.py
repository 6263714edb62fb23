"""The files on which the results of a run file depend, and their digests.

They are the models of its plants with everything that these include and refer to, matrices, set-points and disturbances
that are columns of files, and code of the user's own with what it imports from beside it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from icmj.engine.model_files import list_files
from icmj.errors import RunFileError
from icmj.runfile.schema import RunFile
from icmj.runfile.target import find_files
from icmj.work.folder import digest_of
from icmj.work.own_code import REFERENCE


def plant_files(run: RunFile) -> tuple[Path, ...]:
    """The files of the plants and of the set-point; a run file that holds its own matrices is none of them.

    Raises:
        ModelError: if a model, or what it includes, cannot be read.
    """
    found: dict[Path, None] = {}
    for path in dict.fromkeys((run.assumed_path, run.actual_path)):
        if path.suffix in (".npz", ".json"):
            found[path] = None
        elif path.suffix != ".toml":
            found |= dict.fromkeys(list_files(path))
    return tuple(found | dict.fromkeys(find_files(run.setpoint, run.path)))


def references(*said: Any) -> Iterator[str]:
    """What looks like ``module:name`` in plain data, at any depth."""
    left = list(said)
    while left:
        value = left.pop()
        if isinstance(value, Mapping):
            left += value.values()
        elif isinstance(value, list | tuple):
            left += value
        elif isinstance(value, str) and re.fullmatch(REFERENCE, value):
            yield value


def digests(run: RunFile) -> dict[str, str]:
    """SHA-256 of each file on which results of a run file depend, by its path from the run file.

    Code is that which may be run; of an installed module it is the file that ``module:name`` names.

    Raises:
        ModelError, RunFileError: if one cannot be read.
    """
    home, found = run.path.parent, {}
    files = [*plant_files(run)]
    files += [home / name for table in run.simulation.disturbance for name in table.files]
    for reference in sorted(set(references(run.model_dump()))) if run.code.allowed else ():
        found[reference] = run.code.digest(reference)
        files += run.code.sources(reference)
    for path in dict.fromkeys(files):
        try:
            found[Path(os.path.relpath(path, home)).as_posix()] = digest_of(path)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            raise RunFileError(f"{run.path}: {path}: cannot be read ({why})") from error
    return found
