"""The family file: a run file whose numbers are unknown, what is known of each before, and where it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from icmj.errors import RunFileError
from icmj.runfile.reading import FileOfRuns, parse_toml, read_text
from icmj.runfile.schema import RunFile
from icmj.runfile.table import MOST, Finite, Line, Name, Positive, TomlTable
from icmj.work.shipped import FAMILIES

PRESSURE = "pressure.torque."
"""Begins a key that is a weight of the centre of pressure and none of the run file."""


class FamilyTable(TomlTable):
    """Name of the family, and the run file from which its members are made."""

    name: Name
    """Name of the family."""
    title: Line = ""
    """Title in tables and figures (default: the name)."""
    run: str
    """Run file, in the folder of this file or shipped. Trials have their own duration and are recorded at 100 Hz."""
    set: dict[str, Any] = {}
    """Values of the run file that are replaced, by dotted keys."""


class PressureTable(TomlTable):
    """Computation of the centre of pressure from the states of the plant: −(torque at the ankle) / weight."""

    weight: Positive
    """Vertical force on the feet [N]."""
    torque: Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST)]
    """Weights of the plant's states in the torque on the body at the ankle, by name [N m per unit of the state]."""


class PriorTable(TomlTable):
    """Prior distribution of a parameter, before recordings are taken into account."""

    kind: Literal["uniform", "log-uniform", "normal", "log-normal"]
    """Kind of distribution. For ``log-uniform`` and ``log-normal``, the logarithm is uniform or normal."""
    low: Finite | None = None
    """Smallest value (required for the uniform distributions; default for the others: none)."""
    high: Finite | None = None
    """Largest value (required for the uniform distributions; default for the others: none)."""
    median: Finite | None = None
    """Median of the normal distributions before they are truncated at ``low`` and ``high``."""
    deviation: Positive | None = None
    """Standard deviation of the normal distributions before truncation; for ``log-normal``, of the natural
    logarithm."""

    @model_validator(mode="after")
    def _is_one(self) -> PriorTable:
        uniform, log = self.kind.endswith("uniform"), self.kind.startswith("log")
        needed, foreign = ("low", "high"), ["median", "deviation"]
        if not uniform:
            needed, foreign = ("median", "deviation"), []
        for name in needed:
            if getattr(self, name) is None:
                raise ValueError(f"a {self.kind} prior needs {name}")
        for name in foreign:
            if getattr(self, name) is not None:
                raise ValueError(f"a {self.kind} prior has no {name}")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"low {self.low:g} is not below high {self.high:g}")
        if log and any(value is not None and value <= 0 for value in (self.low, self.high, self.median)):
            raise ValueError(f"a {self.kind} prior is of positive numbers")
        return self


class ParameterTable(TomlTable):
    """One unknown parameter."""

    name: Name
    """Name of the parameter in tables, figures and files."""
    unit: Line = ""
    """Unit of the parameter."""
    title: Line = ""
    """Description in words (default: the name)."""
    keys: Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST)]
    """Keys of the run file that the parameter sets, each with a factor: ``{ "simulation.disturbance[1].size" = 0.5 }``
    sets this size to half the parameter. With a key ``pressure.torque.STATE``, the product is added to the weight of
    this state in the centre of pressure."""
    prior: PriorTable
    """Prior distribution of the parameter."""
    source: Line
    """Source of the prior, or ``ours``."""


class FamilyFile(FileOfRuns):
    """A family file (docs/fitting.md).

    Attributes:
        family: name, run file.
        pressure: the centre of pressure.
        parameter: the unknown parameters.
    """

    family: FamilyTable
    """Name and run file of the family."""
    pressure: PressureTable
    """Computation of the centre of pressure from the states of the plant."""
    parameter: Annotated[list[ParameterTable], Field(min_length=1, max_length=50)]
    """The unknown parameters, one ``[[parameter]]`` each."""

    _base: RunFile = PrivateAttr()

    @classmethod
    def validated(cls, data: Mapping[str, Any], path: Path, text: str = "", allow_code: bool = False) -> FamilyFile:
        """A family file of plain data; its run file lies beside ``path``, or is a shipped one.

        Raises:
            RunFileError: one line that names the file, the key, and what was expected.
        """
        made = cls._read(data, path, text)
        made._base = made._run(made.family.run, made.family.set, "family.set", allow_code)
        if made._base.setpoint:
            raise RunFileError(
                f"{path}: family.run: {made.family.run} has a set-point; the run of a family must have none"
            )
        return made

    @model_validator(mode="after")
    def _names_differ(self) -> FamilyFile:
        for what, names in (
            ("parameters are called", [each.name for each in self.parameter]),
            ("parameters set", [key for each in self.parameter for key in each.keys]),
        ):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"two {what} {twice[0]}")
        return self

    @property
    def base(self) -> RunFile:
        """The run file that the numbers are put into."""
        return self._base


def load_family_file(path: Path | str, *, allow_code: bool = False) -> FamilyFile:
    """Read and validate a family file and its run file; the name of a shipped one stands for it.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path, text = read_text(Path(path), FAMILIES)
    return FamilyFile.validated(parse_toml(text, path), path, text, allow_code)
