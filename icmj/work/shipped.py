"""The run files and models that come with icmj, by their bare names: three-link-0.9, three_link.

They lie inside the package, in ``icmj/shipped/``: in a checkout that leads to ``runs/`` and ``models/``, in a wheel it
holds them. What lies in the user's folder comes before them.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from icmj.base.similar_names import find_nearest
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
        """The folder that contains them."""
        led = SHIPPED / self.kind
        # where git makes no links, as on most of Windows, a checkout has text in their place
        return (SHIPPED.parent.parent / self.kind if led.is_file() else led).resolve()

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

    def beside(self, folder: Path, name: str) -> Path:
        """The file that a file in ``folder`` means by ``name``: one there, else the shipped one of this name."""
        path = folder / name
        return path if Path(name).name != name or path.exists() else self.files.get(name, path)

    def near(self, path: Path) -> str:
        """``; did you mean three-link-0.9?`` for a file that is not there: one beside it, or a shipped one.

        Where none is near and ``path`` may be a name: the names of all shipped ones, and the command that describes
        them.
        """
        beside = [str(other) for other in path.parent.glob(f"*{self.suffix}")]
        near = find_nearest(str(path), beside) or find_nearest(path.name.removesuffix(self.suffix), self.files)
        if near is not None:
            return f"; did you mean {near}?"
        kind = "cases" if self.kind == "runs" else self.kind
        if len(path.parts) != 1 or path.suffix:
            return ""
        described = "" if self.kind == "models" else "; icmj cases describes them"
        return f"; shipped {kind}: {', '.join(self.files)}{described}"


RUNS, MODELS = Shelf("runs", ".toml"), Shelf("models", ".xml")
SWEEPS, EXPERIMENTS, FAMILIES = (Shelf(kind, ".toml") for kind in ("sweeps", "experiments", "families"))


@dataclass(frozen=True)
class ShippedFile:
    """A file that comes with icmj, and what it is.

    Attributes:
        name: its bare name, by which commands take it.
        title: of the case, sweep or experiment.
        about: the first sentence of the comment that the file begins with.
        file: where it lies.
    """

    name: str
    title: str
    about: str
    file: Path


def describe_shipped() -> dict[str, tuple[ShippedFile, ...]]:
    """All that is shipped but models: ``cases`` of the study; other cases by their folder, ``rivals`` (under other
    controllers) and ``joystick`` (plants of experiments); ``sweeps``, ``experiments`` and ``families``.
    """
    kinds = ("cases", "rivals", "joystick", "sweeps", "experiments", "families")
    groups: dict[str, tuple[ShippedFile, ...]] = dict.fromkeys(kinds, ())
    for shelf in (RUNS, SWEEPS, EXPERIMENTS, FAMILIES):
        for name, file in shelf.files.items():
            kind = "cases" if file.parent == RUNS.folder else file.parent.name
            groups[kind] = (*groups.get(kind, ()), _describe(name, file))
    return groups


def _describe(name: str, file: Path) -> ShippedFile:
    text = file.read_text(encoding="utf-8")
    head = " ".join(re.findall(r"\A((?:#.*\n)*)", text)[0].replace("#", " ").split())
    tables = tomllib.loads(text)
    title = next(tables[kind]["title"] for kind in ("experiment", "sweep", "family", "case") if kind in tables)
    return ShippedFile(name, title, re.split(r"(?<=\.)\s+(?=[A-Z`])", head)[0], file)


def model_file(path: Path) -> Path:
    """The MJCF file that somebody means by ``path``.

    Raises:
        ModelError: if there is none.
    """
    meant = MODELS.meant(path)
    if not meant.exists():
        raise ModelError(f"{path}: no such model file{MODELS.near(path)}")
    return meant
