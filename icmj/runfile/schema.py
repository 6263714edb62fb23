"""What a run file may say: its tables, keys and ranges, and the plain data that each table stands for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from icmj.controller.design import Design
from icmj.controller.trigger import BoxTrigger, EventRule, EventTrigger, as_weight
from icmj.errors import SimulationError
from icmj.simulation.settings import NOISE_TERMS, Bias, Impulse, Integrator, Noise, Settings, Source, Step

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Weight = Literal["output", "identity"] | list[Finite] | list[list[Finite]]


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
    title: str
    paper: Paper = Paper()


class Assumed(TomlTable):
    """The plant that the controller believes in."""

    model: str
    keyframe: str | None = None
    delay: NonNegative = 0.0


class Actual(TomlTable):
    """The plant that is really there: another model, or the same one with a deviation."""

    model: str | None = None
    keyframe: str | None = None
    gain: Finite | list[Finite] = 1.0
    dynprm: dict[str, list[Finite]] = {}
    rho: Finite = 1.0
    delay: NonNegative | None = None


class Weights(TomlTable):
    """LQ weights of state feedback (Q_c, R_c) and observer (Q_o, R_o)."""

    Q_c: Weight = "output"
    R_c: Positive | list[Positive] = 1.0
    Q_o: Literal["input", "identity"] | list[Finite] | list[list[Finite]] = "input"
    R_o: Positive | list[Positive] = 1.0


class Control(TomlTable):
    """Hold and event rule: ``quadratic`` by Q_t and q_t, or ``box`` by a threshold for each output or state.

    ``delta_min`` is Δ_min, the least time between two events [s]: what psychologists call the refractory period.
    """

    hold: Literal["system-matched", "zero-order"] = "system-matched"
    rule: Literal["quadratic", "box"] = "quadratic"
    Q_t: Weight = "output"
    q_t: Positive | None = None
    on: Literal["output", "state"] = "output"
    threshold: Positive | list[Positive] | None = None
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

    delta_max: Positive = 3.0


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
    """Coloured noise on one input, or on one output as the observer reads it.

    Standard deviation ``size``, flat up to ``bandwidth`` [Hz] or a first-order low-pass with its ``corner`` [Hz], from
    ``seed``; see :class:`icmj.simulation.settings.Noise`.
    """

    kind: Literal["noise"]
    input: str | None = None
    size: Positive
    bandwidth: Positive | None = None
    seed: Annotated[int, Field(ge=0)]
    start: NonNegative = 0.0
    output: str | None = None
    corner: Positive | None = None
    terms: Annotated[int, Field(ge=1)] = NOISE_TERMS

    def source(self) -> Source:
        """The source that it stands for."""
        return Noise(self.input, self.size, self.bandwidth, self.seed, self.start, self.output, self.corner, self.terms)


class BiasTable(TomlTable):
    """A constant error of one output as the observer reads it: ``size`` from ``start`` [s] on."""

    kind: Literal["bias"]
    output: str
    size: Finite
    start: NonNegative = 0.0

    def source(self) -> Source:
        """The source that it stands for."""
        return Bias(self.output, self.size, self.start)


SourceTable = Annotated[ImpulseTable | StepTable | NoiseTable | BiasTable, Field(discriminator="kind")]


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
