"""Files that a run file refers to, as stored in a log: models with their included files, matrices, set-points."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from icmj.base.text import one_line
from icmj.errors import RunFileError

MOST_BYTES = 10_000_000  # of all files together; a log of more goes without them


@dataclass(frozen=True)
class Kept:
    """Files by their paths below a folder that holds them all, and the run file, too.

    Attributes:
        place: path of the run file there.
        files: contents by path.
        assumed, actual: paths of the two plants' files, where the run file names them by absolute paths; else "".
    """

    place: str = "run.toml"
    files: Mapping[str, bytes] = field(default_factory=dict)
    assumed: str = ""
    actual: str = ""

    @contextmanager
    def written(self) -> Iterator[tuple[Path, dict[str, str]]]:
        """A temporary folder with the files: the run file's path there, and the keys of it that change."""
        with tempfile.TemporaryDirectory(prefix="icmj-models-") as folder:
            place = self.write(Path(folder))
            named = {"assumed": self.assumed, "actual": self.actual}
            yield (
                place,
                {
                    f"{plant}.{'matrices' if name.endswith(('.npz', '.json')) else 'model'}": str(Path(folder, name))
                    for plant, name in named.items()
                    if name
                },
            )

    def write(self, folder: Path) -> Path:
        """Write the files into ``folder``; returns the path that the run file has there.

        Raises:
            RunFileError: if a path leads out of the folder, or a file cannot be written.
        """
        try:
            for name, content in self.files.items():
                target = folder / _inside(name)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
            place = folder / _inside(self.place)
            place.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RunFileError(f"{folder}: the model of the log cannot be written: {error.strerror}") from error
        return place


def _inside(name: str) -> PurePosixPath:
    path = PurePosixPath(name)
    if path.is_absolute() or not path.parts or {"..", ""} & set(path.parts) or "\\" in name or ":" in name:
        raise RunFileError(f"the log carries a file at {one_line(name, 80)!r}, which leads out of a folder")
    return path
