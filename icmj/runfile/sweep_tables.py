"""The files of many runs, sweeps and families, and the JSON Schema of all files.

The sweep file: one case at many points; which fields vary, and what is computed at each point.

What the folder of a sweep says that it is of (``sweep.json``), as far as it is read again.

The family file: a run file whose numbers are unknown, what is known of each before, and where it comes from.

The JSON Schema of a kind of file, with which editors complete and check them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, StringConstraints, ValidationError, model_validator

from icmj.base import VERSION
from icmj.base.array import MOST_ENTRIES, Array, Finite, Positive, Seed
from icmj.base.text import attribute_docstrings
from icmj.errors import RunFileError
from icmj.plant.body import What
from icmj.runfile.reading import FileOfRuns, parse_toml, read_text
from icmj.runfile.schema import RunFile
from icmj.runfile.table import Line, Name, TomlTable, read_meanings
from icmj.work.shipped import FAMILIES, SWEEPS

MOST_POINTS = 10**9
RESERVED = (
    r"point|root_(real|imag)|status|words|attractors?(_.*)?|(predicted|linear|mujoco)_.*"  # columns of what comes out
)
_TABLES = ("assumed", "actual", "design", "controller", "analysis", "simulation")
_Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=60)]
_Plant = Literal["linear", "mujoco"]
_Word = Annotated[str, StringConstraints(max_length=300, pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]*$")]


class SweepHeadTable(TomlTable):
    """Name and title of the sweep, its run file, and how samples are drawn."""

    name: Name
    """Name of the sweep and of its folder."""
    title: Line = ""
    """Title in tables and figures (default: the title of the case, and what varies)."""
    run: str
    """Run file whose fields vary, relative to the sweep file, or the name of a shipped case."""
    samples: Annotated[int, Field(ge=1, le=MOST_POINTS)] | None = None
    """Number of samples of the fields that have only ``low`` and ``high``."""
    method: Literal["random", "sobol"] = "sobol"
    """How samples are drawn: independently, or as a scrambled Sobol sequence, which fills the space evenly."""
    seed: Seed = 0
    """Seed of the samples."""
    chunk: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of points in a task of a process (default: a few seconds of work)."""


class DeviationTable(TomlTable):
    """A change of the actual plant whose factor or value varies; see :mod:`icmj.plant.body`."""

    what: What
    """Property to change."""
    of: str | None = None
    """Name of the element whose property changes (default: all elements that have the property)."""
    by: Literal["factor", "value"] = "factor"
    """Whether a factor on the property varies, or its value."""


class VaryTable(TomlTable):
    """One field or change that varies.

    Its values are ``values``, or ``count`` values from ``low`` to ``high``, or, without a count, samples between them.
    """

    field: str | Annotated[list[str], Field(min_length=1, max_length=20)] | None = None
    """Field of the run file by its dotted key, such as ``actual.gain``; a list of fields gets the same value."""
    change: DeviationTable | None = None
    """Change of the actual plant that varies, instead of a field."""
    name: _Name | None = None
    """Name of the column (default: the last part of the key)."""
    values: Annotated[list[Any], Field(min_length=1, max_length=100_000)] | None = None
    """Values: numbers, texts or lists that the field accepts."""
    low: Finite | None = None
    """Lowest value."""
    high: Finite | None = None
    """Highest value."""
    count: Annotated[int, Field(ge=2, le=100_000)] | None = None
    """Number of values from ``low`` to ``high``, both included."""
    spacing: Literal["linear", "log"] = "linear"
    """Spacing of the values or samples: equal differences or equal ratios."""

    @property
    def fields(self) -> tuple[str, ...]:
        """Dotted keys of the run file that get the value; none for a change."""
        return () if self.field is None else (self.field,) if isinstance(self.field, str) else tuple(self.field)

    @property
    def column(self) -> str:
        """Name of the column."""
        if self.name:
            return self.name
        if self.change:
            return "_".join(part.replace(" ", "_") for part in (self.change.what, self.change.of) if part)
        return self.fields[0].rpartition(".")[2]

    @property
    def sampled(self) -> bool:
        """Whether values are sampled rather than listed."""
        return self.values is None and self.count is None

    @model_validator(mode="after")
    def _is_one_thing(self) -> VaryTable:
        if (self.field is None) == (self.change is None):
            raise ValueError("give one of field and change")
        if (self.values is None) == (self.low is None and self.high is None):
            raise ValueError("give either values, or low and high")
        if self.values is not None and self.count is not None:
            raise ValueError("values have no count")
        if self.values is not None and "spacing" in self.model_fields_set:
            raise ValueError("values have no spacing")
        if self.values is None:
            if self.low is None or self.high is None or not self.low < self.high:
                raise ValueError("low must be given and be less than high")
            if self.spacing == "log" and self.low <= 0:
                raise ValueError("a log spacing needs a low greater than 0")
        for key in self.fields:
            table, _, rest = key.partition(".")
            if table not in _TABLES or not rest:
                raise ValueError(f"{key!r} is no field that varies; expected table.key of {', '.join(_TABLES)}")
        return self


class AskTable(TomlTable):
    """The results that are computed at each point in addition to the prediction."""

    motion: Annotated[list[_Plant], Field(max_length=2)] = []
    """Plants on which the case is simulated and its motion measured; under noise, its statistics."""
    cycle: Annotated[list[_Plant], Field(max_length=2)] = []
    """Plants whose exact cycle is computed by Newton's method, attracting or not; needs a run file
    without a set-point."""
    attractors: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of random starts of the linear plant in the search for coexisting motions; seed and scale are those of the
    run file."""


class SweepFile(FileOfRuns):
    """A validated sweep file; ``base`` is the run file that it names."""

    sweep: SweepHeadTable
    """Name, run file and sampling."""
    vary: Annotated[list[VaryTable], Field(min_length=1, max_length=20)]
    """Fields or changes that vary."""
    ask: AskTable = AskTable()
    """What is computed."""
    set: dict[str, Any] = {}
    """Values of the run file that are replaced at every point, such as ``set.simulation.duration = 20.0``."""

    _base: RunFile = PrivateAttr()

    @classmethod
    def validated(
        cls,
        data: Mapping[str, Any],
        path: Path,
        text: str = "",
        base: RunFile | None = None,
        allow_code: bool = False,
    ) -> SweepFile:
        """A sweep file of plain data; its run file lies beside ``path``, if ``base`` is not it.

        Raises:
            RunFileError: one line that names the file, the key, and what was expected.
        """
        made = cls._read(data, path, text)
        varied = {name: "[[vary]] gives its values" for vary in made.vary for name in vary.fields}
        made._base = made._run(base or made.sweep.run, made.set, "set", allow_code, varied)
        if not made._base.has_events and (made.ask.cycle or made.ask.attractors):
            raise RunFileError(
                f"{path}: [ask] cycle and attractors are for intermittent control; the controller is of kind "
                f"{made._base.controller.kind!r}, ask for its motion"
            )
        if made._base.setpoint and made.ask.cycle:
            raise RunFileError(f"{path}: [ask] a cycle is that of r = 0; take setpoint out of the run file")
        return made

    @model_validator(mode="after")
    def _fits_together(self) -> SweepFile:
        drawn = [vary.column for vary in self.vary if vary.sampled]
        if drawn and self.sweep.samples is None:
            raise ValueError(f"{drawn[0]} is drawn between low and high: sweep.samples says how often, or give a count")
        if self.sweep.samples is not None and not drawn:
            raise ValueError("sweep.samples: nothing is drawn; give a field low and high without a count")
        if not drawn and (unused := {"method", "seed"} & self.sweep.model_fields_set):
            raise ValueError(f"sweep.{min(unused)}: nothing is drawn; leave it out")
        if self.sweep.method == "sobol" and (self.sweep.samples or 0) > 2**30:
            raise ValueError("sweep.samples: a Sobol sequence has at most 2^30 points")
        seen: set[str] = set()
        for name in (vary.column for vary in self.vary):
            if re.fullmatch(RESERVED, name, re.IGNORECASE):
                raise ValueError(
                    f"what varies is called {name!r}, which the table calls what comes out; give it another name"
                )
            if name in seen:
                raise ValueError(f"two things that vary are called {name!r}; give one a name")
            seen.add(name)
        return self

    @property
    def base(self) -> RunFile:
        """The run file whose fields vary."""
        return self._base


def load_sweep(path: Path | str, *, allow_code: bool = False) -> SweepFile:
    """Read and validate a sweep file and the run file that it names; ``allow_code`` as of :func:`icmj.load_run`.

    Raises:
        RunFileError: one line that names the file, the line or key, and what was expected.
    """
    path, text = read_text(Path(path), SWEEPS)
    return SweepFile.validated(parse_toml(text, path), path, text, allow_code=allow_code)


class Facts(BaseModel):
    """What a folder says that it is of.

    Attributes:
        fingerprint: of all that decides what comes out.
        name, title: of the sweep file.
        points: how many there are to be.
        chunk: points of one file.
        varies: columns of what varies.
        fields: of the run file that they are, "" for a change of the model.
        outputs: of the plant.
        measures: names of the numbers of the user's own measures.
        units: of what varies and of the outputs, by name, where they are known.
        versions: of what computed, by package.
    """

    model_config = ConfigDict(strict=True, frozen=True)
    fingerprint: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{16}$")]
    name: Name
    title: _Word
    points: Annotated[int, Field(ge=1, le=MOST_POINTS)]
    chunk: Annotated[int, Field(ge=1, le=100_000)]
    varies: list[_Word]
    fields: list[_Word]
    outputs: list[_Word]
    measures: list[_Word] = []
    units: dict[str, _Word] = {}
    versions: dict[str, _Word]

    @model_validator(mode="after")
    def _fit(self) -> Facts:
        if len(self.varies) != len(self.fields):
            raise ValueError("varies and fields differ in length")
        return self

    @property
    def chunks(self) -> int:
        """How many files there are to be."""
        return -(-self.points // self.chunk)

    def rows(self, chunk: int) -> range:
        """The points of one of them, by index."""
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, self.points))


def parse_facts(content: bytes) -> Facts:
    """The facts in JSON text.

    Raises:
        ValueError: in one line, if there are none.
    """
    try:
        return Facts.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise ValueError(f"{where}: {first['msg']}" if where else first["msg"]) from error


_FAR = 7.5  # |z| up to which its share of the distribution is told from 0 and 1
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


SCHEMA_VERSION = 2
"""Rises with every change after which a file that was valid is not any more, or means something else."""


def json_schema(model: type[BaseModel], kind: str, title: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a kind of file: every table and key with its meaning, bounds and default.

    What only the whole file shows, such as whether a joint has that name, is checked when the file is read.
    """
    record = model.model_json_schema()
    _describe(record, model)
    for known in _tables(model):
        if known.__name__ in record.get("$defs", {}):
            _describe(record["$defs"][known.__name__], known)
    facts = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"icmj:{kind}:{SCHEMA_VERSION}"}
    return {**facts, "version": SCHEMA_VERSION, "$comment": f"icmj {VERSION}", **record, "title": title}


def _tables(model: type[BaseModel]) -> set[type[BaseModel]]:
    """Every table of the package: names are unique among them."""
    found, waiting = set[type[BaseModel]](), [BaseModel]
    while waiting:
        below = [cls for cls in waiting.pop().__subclasses__() if cls not in found]
        found.update(below)
        waiting += below
    return {cls for cls in found if cls.__module__.startswith(model.__module__.partition(".")[0])}


def _describe(record: dict[str, Any], model: type[BaseModel]) -> None:
    """Give the keys of a table the docstrings that stand under them."""
    for key, words in docstrings(model).items():
        if (entry := record.get("properties", {}).get(key)) is not None:
            entry["description"] = words


def docstrings(model: type[BaseModel]) -> dict[str, str]:
    """The meaning of the keys of a table, by key: the docstrings under them, or those of its setting."""
    found = dict[str, str]()
    for cls in reversed(model.__mro__):
        if (setting := vars(cls).get("setting")) is not None:
            found |= read_meanings(setting)
    for cls in reversed(model.__mro__):
        if not cls.__module__.startswith("icmj.") or "setting" in vars(cls):
            continue  # what keys_of made has no source of its own: it stands in its base
        found |= attribute_docstrings(cls)
    return {key: words for key, words in found.items() if key in model.model_fields}
