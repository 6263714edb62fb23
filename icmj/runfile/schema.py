"""What a run file may say: its tables, keys and ranges, and the plain data that each table stands for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from icmj.controller.design import Design
from icmj.controller.trigger import BoxTrigger, EventRule, EventTrigger, as_weight
from icmj.errors import SimulationError
from icmj.simulation.settings import Impulse, Integrator, Noise, Settings, Source, Step

# far beyond anything physical, and near enough to 1 for squares and products to be numbers
SMALLEST, LARGEST = 1e-15, 1e12
MOST = 200  # entries of a list: more states, inputs or thresholds than can be computed with
Positive = Annotated[float, Field(ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Numbers = Annotated[list[Finite], Field(min_length=1, max_length=MOST)]
Positives = Annotated[list[Positive], Field(min_length=1, max_length=MOST)]
Matrix = Annotated[list[Numbers], Field(min_length=1, max_length=MOST)]
Weight = Literal["output", "identity"] | Numbers | Matrix
Interval = Annotated[float, Field(ge=1e-6, le=1e4, allow_inf_nan=False)]
Line = Annotated[str, Field(max_length=1000, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]


class TomlTable(BaseModel):
    """Base of all tables: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Paper(TomlTable):
    """What the paper says of this case; shown beside our numbers, never used in a computation."""

    figure: str = ""
    delta_crit: Positive | None = None
    eigenvalue: Literal[1, -1] | None = None
    cycle: bool | None = None
    statements: list[str] = []
    note: str = ""


class Identity(TomlTable):
    """Name (also the log's file name) and title."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)]
    title: Line
    paper: Paper = Paper()


class Assumed(TomlTable):
    """The plant that the controller believes in."""

    model: str
    keyframe: str | None = None


class Actual(TomlTable):
    """The plant that is really there: another model, or the same one with a deviation."""

    model: str | None = None
    keyframe: str | None = None
    gain: Finite | Numbers = 1.0
    dynprm: dict[str, Annotated[list[Finite], Field(max_length=10)]] = {}  # as many as MuJoCo keeps
    rho: Finite = 1.0


class Weights(TomlTable):
    """LQ weights of state feedback (Q_c, R_c) and observer (Q_o, R_o)."""

    Q_c: Weight = "output"
    R_c: Positive | Positives = 1.0
    Q_o: Literal["input", "identity"] | Numbers | Matrix = "input"
    R_o: Positive | Positives = 1.0


class Control(TomlTable):
    """Hold and event rule: ``quadratic`` by Q_t and q_t, or ``box`` by a threshold for each output or state."""

    hold: Literal["system-matched", "zero-order"] = "system-matched"
    rule: Literal["quadratic", "box"] = "quadratic"
    Q_t: Weight = "output"
    q_t: Positive | None = None
    on: Literal["output", "state"] = "output"
    threshold: Positive | Positives | None = None
    delta_min: NonNegative = 1e-3

    def trigger(self, design: Design) -> EventRule:
        """The event rule for a controller of this design.

        Raises:
            AnalysisError: if it does not fit the design.
        """
        if self.rule == "box":
            assert self.threshold is not None
            return BoxTrigger(np.array(self.threshold), self.on, self.delta_min)
        assert self.q_t is not None
        return EventTrigger(as_weight(self.Q_t, design), self.q_t, self.delta_min)

    @model_validator(mode="after")
    def _keys_are_those_of_the_rule(self) -> Control:
        needed, others = ("threshold", ("Q_t", "q_t")) if self.rule == "box" else ("q_t", ("on", "threshold"))
        if getattr(self, needed) is None:
            raise ValueError(f"the {self.rule} rule needs {needed}")
        foreign = [name for name in others if name in self.model_fields_set]
        if foreign:
            raise ValueError(f"the {self.rule} rule has no {foreign[0]}")
        return self


class Analysis(TomlTable):
    """Range of Δ searched for crossings [s]."""

    delta_max: Interval = 3.0


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
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
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
    disturbance: Annotated[list[SourceTable], Field(max_length=MOST)] = []
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
    law_q_t: Annotated[list[Positive], Field(max_length=MOST)] = []
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
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

    @model_validator(mode="after")
    def _law_needs_two_points(self) -> RunFile:
        if len(self.study.law_q_t) == 1:
            raise ValueError("study.law_q_t needs at least two thresholds to fit a slope")
        return self

    @property
    def text(self) -> str:
        """The TOML text as read."""
        return self._text

    @property
    def path(self) -> Path:
        """Where it was read from; model files are relative to its folder."""
        return self._path

    @property
    def assumed_path(self) -> Path:
        """The assumed plant's MJCF file."""
        return self._path.parent / self.assumed.model

    @property
    def actual_path(self) -> Path:
        """The actual plant's MJCF file; the assumed plant's if none is named."""
        return self._path.parent / (self.actual.model or self.assumed.model)
