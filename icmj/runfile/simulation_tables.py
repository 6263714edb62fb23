"""The tables of a run: how it is simulated, what disturbs it, and what the study adds."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from icmj.errors import SimulationError
from icmj.runfile.table import (
    MOST,
    Finite,
    NonNegative,
    Positive,
    TomlTable,
)
from icmj.simulation.settings import NOISE_TERMS, Bias, Impulse, Integrator, Noise, Settings, Source, Step


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
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
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
