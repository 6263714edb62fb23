"""What a run file may say: its tables, keys and ranges, and the plain data that each table stands for."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from icmj.controller.design import Design
from icmj.controller.trigger import EventRule, EventTrigger, as_weight
from icmj.errors import ModelError, RunFileError, SimulationError
from icmj.plant.change import Change, What
from icmj.plant.notice import Kind
from icmj.plant.operating import OperatingKind, OperatingRule
from icmj.plant.person import Person
from icmj.plant.selection import Selection
from icmj.runfile.person import PersonTable
from icmj.runfile.writing import to_toml
from icmj.simulation.settings import Impulse, Integrator, Noise, Settings, Source, Step

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Weight = Literal["output", "identity"] | list[Finite] | list[list[Finite]]


class TomlTable(BaseModel):
    """Base of all tables: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Paper(TomlTable):
    """What the paper says of this case; shown beside our numbers, never used in a computation.

    ``fingerprint`` is that of the run file it speaks of (:attr:`RunFile.fingerprint`). In a copy with another plant,
    design or rule the block stands for nothing and is left out, with a word. Without a fingerprint it is as stated.
    """

    figure: str = ""
    delta_crit: Positive | None = None
    eigenvalue: Literal[1, -1] | None = None
    cycle: bool | None = None
    statements: list[str] = []
    note: str = ""
    fingerprint: str = ""


class Identity(TomlTable):
    """Name (also the log's file name) and title."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)]
    title: str
    paper: Paper = Paper()


class PlantTable(TomlTable):
    """What both plants have: operating point, inputs, outputs and states, by name."""

    keyframe: str | None = None
    operating_point: OperatingKind | None = None
    free: list[str] = []
    pose: dict[str, Finite] = {}
    inputs: list[str] | None = None
    outputs: list[str] | Literal["joints"] | None = None
    states: list[str] | None = None
    drop: list[str] = []
    person: PersonTable | None = None

    @property
    def measures(self) -> Person | None:
        """Whose measures the model gets, if anyone's."""
        return self.person.person() if self.person else None

    @property
    def operating(self) -> OperatingRule:
        """The rule for the operating point that it stands for."""
        return OperatingRule(self.operating_point or "as given", tuple(self.free), self.pose)

    @model_validator(mode="after")
    def _only_balance_frees(self) -> PlantTable:
        if self.free and self.operating_point != "balance":
            raise ValueError('free needs operating_point = "balance"')
        return self

    @property
    def selection(self) -> Selection:
        """The selection that it stands for."""
        outputs = self.outputs if isinstance(self.outputs, str) else _names(self.outputs)
        return Selection(_names(self.inputs), outputs, _names(self.states), tuple(self.drop))


class Assumed(PlantTable):
    """The plant that the controller believes in."""

    model: str


class ChangeTable(TomlTable):
    """One named change; see :mod:`icmj.plant.change` for what there is."""

    what: What
    of: str | None = None
    factor: Finite | None = None
    value: Finite | list[Finite] | None = None

    def change(self) -> Change:
        """The change that it stands for.

        Raises:
            ModelError: if it is not one.
        """
        value = tuple(self.value) if isinstance(self.value, list) else self.value
        return Change(self.what, self.of, self.factor, value)

    @model_validator(mode="after")
    def _is_one(self) -> ChangeTable:
        try:
            self.change()
        except ModelError as error:
            raise ValueError(str(error)) from error
        return self


class Actual(PlantTable):
    """The plant that is really there: another model, or the same one, with or without changes.

    Where it names no inputs or outputs they are those of the assumed plant, by name; where it has no operating point it
    finds its own by the assumed plant's rule, from where the assumed plant rests.
    """

    model: str | None = None
    gain: Finite | list[Finite] = 1.0
    dynprm: dict[str, list[Finite]] = {}
    change: list[ChangeTable] = []
    rho: Finite = 1.0


def _names(given: list[str] | None) -> tuple[str, ...] | None:
    return None if given is None else tuple(given)


class Weights(TomlTable):
    """LQ weights of state feedback (Q_c, R_c) and observer (Q_o, R_o)."""

    Q_c: Weight = "output"
    R_c: Positive | list[Positive] = 1.0
    Q_o: Literal["input", "identity"] | list[Finite] | list[list[Finite]] = "input"
    R_o: Positive | list[Positive] = 1.0


class Control(TomlTable):
    """Hold and event rule."""

    hold: Literal["system-matched", "zero-order"] = "system-matched"
    Q_t: Weight = "output"
    q_t: Positive
    delta_min: NonNegative = 1e-3

    def trigger(self, design: Design) -> EventRule:
        """The event rule for a controller of this design.

        Raises:
            AnalysisError: if it does not fit the design.
        """
        return EventTrigger(as_weight(self.Q_t, design), self.q_t, self.delta_min)


class Analysis(TomlTable):
    """Range of Δ searched for crossings [s], and what to go on with although it makes a prediction doubtful."""

    delta_max: Positive = 3.0
    allow: list[Kind] = []


class ImpulseTable(TomlTable):
    """A torque impulse on one input: ``size`` [N m s] spread evenly over ``duration`` [s] from ``start`` [s]."""

    kind: Literal["impulse"]
    input: str
    size: Finite
    start: NonNegative = 0.0
    duration: Positive = 0.05

    def source(self) -> Source:
        """The source that it stands for."""
        return Impulse(self.input, self.size, self.start, self.duration)


class StepTable(TomlTable):
    """A torque step on one input: ``size`` [N m] from ``start`` [s] on."""

    kind: Literal["step"]
    input: str
    size: Finite
    start: NonNegative = 0.0

    def source(self) -> Source:
        """The source that it stands for."""
        return Step(self.input, self.size, self.start)


class NoiseTable(TomlTable):
    """Band-limited noise on one input: standard deviation ``size`` [N m], up to ``bandwidth`` [Hz], from ``seed``."""

    kind: Literal["noise"]
    input: str
    size: Positive
    bandwidth: Positive
    seed: Annotated[int, Field(ge=0)]
    start: NonNegative = 0.0

    def source(self) -> Source:
        """The source that it stands for."""
        return Noise(self.input, self.size, self.bandwidth, self.seed, self.start)


SourceTable = Annotated[ImpulseTable | StepTable | NoiseTable, Field(discriminator="kind")]


class SimulationTable(TomlTable):
    """How long, from where, and how finely; see :class:`icmj.simulation.Settings`."""

    duration: Positive = 30.0
    initial: dict[str, Finite] = {}
    observer: dict[str, Finite] = {}
    timestep: Positive | None = None
    integrator: Integrator | None = None
    record_interval: Positive = 0.01
    limit: Positive = 1.0
    disturbance: list[SourceTable] = []
    native: bool = True

    def settings(self) -> Settings:
        """The settings that it stands for.

        Raises:
            SimulationError: if they do not fit together.
        """
        plain = {name: getattr(self, name) for name in type(self).model_fields}
        return Settings(**plain | {"disturbance": tuple(table.source() for table in self.disturbance)})

    @model_validator(mode="after")
    def _fits_together(self) -> SimulationTable:
        try:
            self.settings()
        except SimulationError as error:
            raise ValueError(str(error)) from error
        return self


class StudyTable(TomlTable):
    """What the study adds to one run.

    Clock-driven points for panel (a), thresholds for the amplitude law, random starts in search of attractors.
    """

    growth_points: Annotated[int, Field(ge=0, le=200)] = 8
    law_q_t: list[Positive] = []
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    seed: Annotated[int, Field(ge=0)] = 0
    magnification: Positive = 10.0


class RunFile(TomlTable):
    """A validated run file."""

    case: Identity
    assumed: Assumed
    actual: Actual = Actual()
    design: Weights = Weights()
    controller: Control
    analysis: Analysis = Analysis()
    simulation: SimulationTable = SimulationTable()
    study: StudyTable = StudyTable()

    _text: str = PrivateAttr(default="")
    _path: Path = PrivateAttr(default=Path("run.toml"))
    _disowned: bool = PrivateAttr(default=False)

    @classmethod
    def validated(cls, data: Mapping[str, Any], path: Path) -> RunFile:
        """A run file of plain data, its models beside ``path``.

        Raises:
            RunFileError: one line that names the file, the key, and what was expected.
        """
        try:
            run = cls.model_validate(data)
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(str(part) for part in first["loc"]) or "file"
            more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
            shown = "" if first["type"] == "missing" else f", got {first['input']!r:.60}"
            raise RunFileError(f"{path}: {key}: {first['msg']}{shown}{more}") from error
        run._path = path
        return run

    def with_(self, **changes: Any) -> RunFile:
        """The same run file with some values changed, by dotted keys: ``run.with_(**{"actual.gain": 0.85})``.

        Raises:
            RunFileError: if a key is unknown or a value not allowed.
        """
        data = self._data()
        for key, value in changes.items():
            *tables, last = key.split(".")
            table = data
            for name in tables:
                table = table.setdefault(name, {})
                if not isinstance(table, dict):
                    raise RunFileError(f"{self._path}: {key}: {name} is no table")
            table[last] = value
        return type(self).validated(data, self._path)

    def _data(self) -> dict[str, Any]:
        """What it says, as plain data without defaults."""
        return self.model_dump(exclude_defaults=True, exclude_none=True)

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that change with the plants, the design, the hold and the weight of the rule.

        Folders of model files, thresholds and everything about the run do not count.
        """
        data = {name: self._data().get(name, {}) for name in ("assumed", "actual", "design")}
        for table in (data["assumed"], data["actual"]):
            if "model" in table:
                table["model"] = Path(table["model"]).name
        rule = self.controller.model_dump(include={"hold", "Q_t"})
        content = json.dumps(data | {"rule": rule}, sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:12]

    @property
    def disowned(self) -> bool:
        """Whether it had a paper's block that speaks of another case."""
        return self._disowned

    @model_validator(mode="after")
    def _paper_speaks_of_this(self) -> RunFile:
        stated = self.case.paper.fingerprint
        if stated and stated != self.fingerprint:
            object.__setattr__(self, "case", self.case.model_copy(update={"paper": Paper()}))
            self._disowned = True
        return self

    @model_validator(mode="after")
    def _law_needs_two_points(self) -> RunFile:
        if len(self.study.law_q_t) == 1:
            raise ValueError("study.law_q_t needs at least two thresholds to fit a slope")
        return self

    @property
    def text(self) -> str:
        """The TOML text as read; where the values have been changed since, text that says what they are."""
        if self._text:
            said = type(self).model_validate(tomllib.loads(self._text))
            if said.model_dump() == self.model_dump():
                return self._text
        return f"# written from values that were changed in code after {self._path.name}\n" + to_toml(self._data())

    @property
    def path(self) -> Path:
        """Where it was read from; model files are relative to its folder."""
        return self._path

    @property
    def actual_measures(self) -> Person | None:
        """Whose measures the actual plant gets: by default, of the same model, those of the assumed one."""
        own = self.actual.measures
        return own if own or self.actual.model else self.assumed.measures

    @property
    def assumed_path(self) -> Path:
        """The assumed plant's MJCF file."""
        return self._path.parent / self.assumed.model

    @property
    def actual_path(self) -> Path:
        """The actual plant's MJCF file; the assumed plant's if none is named."""
        return self._path.parent / (self.actual.model or self.assumed.model)
