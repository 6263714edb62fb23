"""The tables of a run: how it is simulated, what disturbs it, and what the study adds."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from icmj.base.environment import SWITCH
from icmj.errors import SimulationError
from icmj.plant.push import ZERO
from icmj.runfile.table import (
    MOST,
    Finite,
    NonNegative,
    Positive,
    Reference,
    TomlTable,
)
from icmj.simulation.settings import NOISE_TERMS, Bias, Impulse, Integrator, Noise, On, Settings, Source, Step

Vector = tuple[Finite, Finite, Finite]
SHORTEST = 1e-6  # s
LONGEST = 1e9  # s, thirty years: the viewer counts nanoseconds in 64 bits


class PlaceTable(TomlTable):
    """Where something acts: on an input, or on any body of a model, at any point. Its shape is in the table's kind."""

    input: str | None = None
    """That it acts on, by name, or"""
    on: On | None = None
    """Of an input: ``"body"`` is on the body itself, 1 N m about a hinge whatever gain, gear and dynamics the actuator
    has, where its length grows; so impulses and steps are by default. ``"command"`` is beside the command and goes
    through all these; so noise is by default."""
    body: str | None = None
    """the body that is pushed, by name, which a model must have,"""
    force: Vector = ZERO
    """by this force [N], times ``size``, along the axes of the world,"""
    torque: Vector = ZERO
    """by this torque [N m], times ``size``, about the axes of the world,"""
    point: Vector | None = None
    """at this point in the body's frame [m]; its centre of mass by default."""

    @property
    def placed(self) -> dict[str, Any]:
        """The keys of the place that are given, as :class:`icmj.simulation.settings.Placed` takes them."""
        keys = ("on", "body", "force", "torque", "point")
        return {
            key: getattr(self, key) for key in keys if key in self.model_fields_set and getattr(self, key) is not None
        }

    def sized(self, size: float | None) -> float:
        """The size, which may be left out where force and torque say all."""
        if size is None and self.body is None:
            raise SimulationError("size is required")
        return 1.0 if size is None else size


class ImpulseTable(PlaceTable):
    """An impulse on an input or a body: ``size`` [N m s] spread evenly over ``duration`` [s] from ``start`` [s]."""

    kind: Literal["impulse"]
    """Of the disturbance."""
    size: Finite | None = None
    """Of the impulse [N m s, or the input's unit times s]; of a body times its force and torque, 1 by default."""
    start: NonNegative = 0.0
    """From when on [s]."""
    duration: Positive = 0.05
    """Over which it is spread [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Impulse(self.input, self.sized(self.size), self.start, self.duration, **self.placed)


class StepTable(PlaceTable):
    """A step on an input or a body: ``size`` [N m] from ``start`` [s] on."""

    kind: Literal["step"]
    """Of the disturbance."""
    size: Finite | None = None
    """Of the step [N m, or the input's unit]; of a body times its force and torque, 1 by default."""
    start: NonNegative = 0.0
    """From when on [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Step(self.input, self.sized(self.size), self.start, **self.placed)


class NoiseTable(PlaceTable):
    """Coloured noise on one input or body, or on one output as the observer reads it.

    Standard deviation ``size``, flat up to ``bandwidth`` [Hz] or a first-order low-pass with its ``corner`` [Hz], from
    ``seed``; see :class:`icmj.simulation.settings.Noise`.
    """

    kind: Literal["noise"]
    """Of the disturbance."""
    size: Positive | None = None
    """Standard deviation [unit of the input or output]; of a body times its force and torque, 1 by default."""
    bandwidth: Positive | None = None
    """Up to which the spectrum is flat [Hz], or"""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
    """Of frequencies and phases."""
    start: NonNegative = 0.0
    """From when on [s]."""
    output: str | None = None
    """the output that it acts on, by name."""
    corner: Positive | None = None
    """where a low-pass spectrum has fallen to half [Hz]."""
    terms: Annotated[int, Field(ge=1)] = NOISE_TERMS
    """Sinusoids that it is made of."""

    def source(self) -> Source:
        """The source that it stands for."""
        size, edge = (
            self.sized(self.size),
            (self.bandwidth, self.seed, self.start, self.output, self.corner, self.terms),
        )
        return Noise(self.input, size, *edge, **self.placed)


class BiasTable(TomlTable):
    """A constant error of one output as the observer reads it: ``size`` from ``start`` [s] on."""

    kind: Literal["bias"]
    """Of the disturbance."""
    output: str
    """That is misread, by name."""
    size: Finite
    """Of the error [unit of the output]."""
    start: NonNegative = 0.0
    """From when on [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Bias(self.output, self.size, self.start)


SourceTable = Annotated[ImpulseTable | StepTable | NoiseTable | BiasTable, Field(discriminator="kind")]


class SimulationTable(TomlTable):
    """How long, from where, and how finely; see :class:`icmj.simulation.Settings`."""

    duration: Annotated[Positive, Field(ge=SHORTEST, le=LONGEST)] = 30.0
    """Of the run [s]."""
    initial: dict[str, Finite] = {}
    """States of the plant by name, and how far from the operating point they start; the others start at it."""
    observer: dict[str, Finite] = {}
    """States of the observer by name; the others start at zero."""
    timestep: Positive | None = None
    """Of the engine [s], in place of a tolerance. The linear plant needs none."""
    integrator: Integrator | None = None
    """Of the engine; the model's own by default."""
    record_interval: Positive = 0.01
    """Between recorded rows [s]; events are always recorded."""
    limit: Positive | dict[str, Positive] | None = None
    """The run has fallen when a position departs further than this: a number for all [rad or m, and as much in another
    unit of angle or length], or positions by name, each in its own unit. By default 1 rad or 1 m; of plants given by
    matrices, what is neither an angle nor a length by its unit has no limit."""
    disturbance: Annotated[list[SourceTable], Field(max_length=MOST)] = []
    """What acts beside the controller."""
    tolerance: Positive | None = None
    """Relative error of an open-loop interval to which the engine's steps are adapted. Without it, timestep and
    integrator: 10⁻⁸ where nothing can touch, rub or reach a limit; else the model's own timestep."""

    def settings(self) -> Settings:
        """The settings that it stands for.

        Raises:
            SimulationError: if they do not fit together.
        """
        plain = {name: getattr(self, name) for name in type(self).model_fields}
        return Settings(**plain | {"disturbance": tuple(table.source() for table in self.disturbance)})

    @model_validator(mode="before")
    @classmethod
    def _of_older_files(cls, data: Any) -> Any:
        """Older files say ``native = true``, which is all that there is by now."""
        if isinstance(data, dict) and "native" in data:
            if data["native"] is not True:
                raise ValueError(f"native = {str(data['native']).lower()} is no key any more: {SWITCH}")
            return {key: value for key, value in data.items() if key != "native"}
        return data

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
    """Clock-driven points for panel (a) of the report."""
    law_q_t: Annotated[list[Positive], Field(max_length=MOST)] = []
    """Thresholds for the amplitude law, two at least [unit of ``controller.q_t``]."""
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    """Random starts in search of other attractors."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Of these starts."""
    magnification: Positive = 10.0
    """Of the sway in the second figure of the viewer."""
    measures: Annotated[list[Reference], Field(max_length=MOST)] = []
    """Measures of one's own: the ``module:name`` of functions of a simulation that give numbers by name."""
