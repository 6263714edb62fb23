"""The run files and models that come with icmj, by their bare names: three-link-0.9, three_link.

They lie inside the package, in ``icmj/shipped/``: in a checkout that leads to ``runs/`` and ``models/``, in a wheel it
holds them. What lies in the user's folder comes before them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from icmj.base.nearness import nearest
from icmj.errors import ModelError

SHIPPED = Path(__file__).resolve().parent.parent / "shipped"


@dataclass(frozen=True)
class Shelf:
    """Files of one kind that come with icmj.

    Attributes:
        kind: name of their folder.
        suffix: of their names.
    """

    kind: str
    suffix: str

    @property
    def folder(self) -> Path:
        """Where they lie."""
        return (SHIPPED / self.kind).resolve()

    @property
    def files(self) -> Mapping[str, Path]:
        """The files by their bare names; those in ``rivals`` and ``joystick`` are not of the study."""
        found = (path for place in ("", "rivals/", "joystick/") for path in self.folder.glob(f"{place}*{self.suffix}"))
        ordered = sorted(found, key=lambda path: (path.parent != self.folder, path))  # the study's first
        return {path.name.removesuffix(self.suffix): path for path in ordered}

    def meant(self, path: Path) -> Path:
        """The file that somebody means by ``path``: what is there, else the shipped one of this name, else ``path``."""
        if len(path.parts) != 1 or path.exists():
            return path
        return self.files.get(path.name, path)

    def near(self, path: Path) -> str:
        """``; did you mean three-link-0.9?`` for a file that is not there: one beside it, or a shipped one.

        Where none is near, and what was given may be a name, the names of all shipped ones.
        """
        beside = [str(other) for other in path.parent.glob(f"*{self.suffix}")]
        near = nearest(str(path), beside) or nearest(path.name.removesuffix(self.suffix), self.files)
        if near is not None:
            return f"; did you mean {near}?"
        kind = "cases" if self.kind == "runs" else self.kind
        return f"; shipped {kind}: {', '.join(self.files)}" if len(path.parts) == 1 and not path.suffix else ""


RUNS, MODELS = Shelf("runs", ".toml"), Shelf("models", ".xml")
SWEEPS, EXPERIMENTS = Shelf("sweeps", ".toml"), Shelf("experiments", ".toml")


def model_file(path: Path) -> Path:
    """The MJCF file that somebody means by ``path``.

    Raises:
        ModelError: if there is none.
    """
    meant = MODELS.meant(path)
    if not meant.exists():
        raise ModelError(f"{path}: no such model file{MODELS.near(path)}")
    return meant
