"""The family file: a run file whose numbers are unknown, what is known of each before, and where it comes from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, PrivateAttr, model_validator

from icmj.base.array import MOST_ENTRIES, Array, Finite, Positive
from icmj.errors import RunFileError
from icmj.runfile.reading import FileOfRuns, parse_toml, read_text
from icmj.runfile.schema import RunFile
from icmj.runfile.table import Line, Name, TomlTable
from icmj.work.shipped import FAMILIES

_FAR = 7.5  # |z| up to which its share of the distribution is told from 0 and 1


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
    torque: Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST_ENTRIES)]
    """Weights of the plant's states in the torque on the body at the ankle, by name [N m per unit of the state]."""


class PriorTable(TomlTable):
    """Prior distribution of a parameter, before recordings are taken into account.

    The parameter is a rising function of a standard normal variable z, so that whatever is said of z keeps its bounds.
    """

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

    def to_normal(self, theta: ArrayLike) -> Array:
        """z of values of the parameter, at most ±7.5; NaN of those beyond its bounds."""
        from scipy.special import ndtr, ndtri

        low, high, median = self._bounds
        with np.errstate(invalid="ignore", divide="ignore"):
            value = np.log(theta) if self.kind.startswith("log") else np.asarray(theta, dtype=float)
        reach = 1e-9 * (1 + np.abs(value))
        inside = (value >= low - reach) & (value <= high + reach)
        if self.deviation is None:
            share = (value - low) / (high - low)
        else:
            a, b = ndtr((np.array([low, high]) - median) / self.deviation)
            share = (ndtr((value - median) / self.deviation) - a) / (b - a)
        return np.where(inside, np.clip(ndtri(np.clip(share, 0.0, 1.0)), -_FAR, _FAR), np.nan)

    def from_normal(self, z: ArrayLike) -> Array:
        """The values of the parameter that have these z."""
        from scipy.special import ndtr, ndtri

        low, high, median = self._bounds
        share = ndtr(np.clip(np.asarray(z, dtype=float), -_FAR, _FAR))
        if self.deviation is None:
            value = low + (high - low) * share
        else:
            a, b = ndtr((np.array([low, high]) - median) / self.deviation)
            value = np.clip(median + self.deviation * ndtri(a + (b - a) * share), low, high)
        return np.asarray(np.exp(value) if self.kind.startswith("log") else value)

    @property
    def _bounds(self) -> Iterator[float]:
        """Low, high and median, or their logarithms; infinite where there is no bound."""
        for value, none in ((self.low, -np.inf), (self.high, np.inf), (self.median, 0.0)):
            yield none if value is None else float(np.log(value)) if self.kind.startswith("log") else value


class ParameterTable(TomlTable):
    """One unknown parameter."""

    name: Name
    """Name of the parameter in tables, figures and files."""
    unit: Line = ""
    """Unit of the parameter."""
    title: Line = ""
    """Description in words (default: the name)."""
    keys: Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST_ENTRIES)]
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
        given = {name: f"the parameter {each.name} sets it" for each in made.parameter for name in each.keys}
        given |= dict.fromkeys(("simulation.duration", "simulation.record_interval"), "trials have their own")
        made._base = made._run(made.family.run, made.family.set, "family.set", allow_code, given)
        if made._base.setpoint:
            raise RunFileError(
                f"{path}: family.run names {made.family.run}, which has a set-point; the run of a family must have none"
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
