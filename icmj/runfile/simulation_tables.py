"""The tables of a run: how it is simulated, what disturbs it, and what the study adds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from icmj.base.environment import SWITCH
from icmj.errors import RunFileError, SimulationError
from icmj.plant.push import ZERO
from icmj.runfile.messages import short
from icmj.runfile.table import (
    LARGEST,
    MOST,
    Finite,
    Line,
    NonNegative,
    Parameters,
    Positive,
    Reference,
    TomlTable,
)
from icmj.simulation.settings import (
    GRID,
    MOST_TERMS,
    NOISE_TERMS,
    Bias,
    Gaussian,
    Impulse,
    Integrator,
    Noise,
    On,
    Settings,
    Sinusoids,
    Source,
    Step,
)
from icmj.work.own_code import Code, accepted, digest_of

Vector = tuple[Finite, Finite, Finite]
SHORTEST = 1e-6  # s
LONGEST = 1e9  # s, thirty years: the viewer counts nanoseconds in 64 bits


class PlaceTable(TomlTable):
    """Where a disturbance acts: on an input, or at any point of any body of a model."""

    input: str | None = None
    """Name of the input that is disturbed; give either ``input`` or ``body``."""
    on: On | None = None
    """For an input: ``"body"`` acts on the body itself, 1 N m about a hinge whatever gain, gear and dynamics the
    actuator has, in the direction in which its length grows (default of impulses and steps); ``"command"`` is added to
    the command and passes through all these (default of noise)."""
    body: str | None = None
    """Name of the body that is pushed; needs a model."""
    force: Vector = ZERO
    """Force on the body in world axes, multiplied by ``size`` [N]."""
    torque: Vector = ZERO
    """Torque on the body in world axes, multiplied by ``size`` [N m]."""
    point: Vector | None = None
    """Point of application in the frame of the body [m] (default: its centre of mass)."""

    @property
    def placed(self) -> dict[str, Any]:
        """The keys of the place that are given, as :class:`icmj.simulation.settings.Placed` takes them."""
        keys = ("on", "body", "force", "torque", "point")
        return {
            key: getattr(self, key) for key in keys if key in self.model_fields_set and getattr(self, key) is not None
        }

    def sized(self, size: float | None) -> float:
        """The size; 1 where force and torque are given and it is left out."""
        if size is None and self.body is None:
            raise SimulationError("size is required")
        return 1.0 if size is None else size


class ImpulseTable(PlaceTable):
    """An impulse on an input or a body: ``size`` [N m s] spread evenly over ``duration`` [s] from ``start`` [s]."""

    kind: Literal["impulse"]
    """Kind of the disturbance."""
    size: Finite | None = None
    """Size of the impulse [N m s, or the unit of the input times s]; for a body, a factor on force and torque (default:
    1)."""
    start: NonNegative = 0.0
    """Start [s]."""
    duration: Positive = 0.05
    """Duration [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Impulse(self.input, self.sized(self.size), self.start, self.duration, **self.placed)


class StepTable(PlaceTable):
    """A step on an input or a body: ``size`` [N m] from ``start`` [s] on."""

    kind: Literal["step"]
    """Kind of the disturbance."""
    size: Finite | None = None
    """Size of the step [N m, or the unit of the input]; for a body, a factor on force and torque (default: 1)."""
    start: NonNegative = 0.0
    """Start [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Step(self.input, self.sized(self.size), self.start, **self.placed)


class NoiseTable(PlaceTable):
    """Coloured noise on one input or body, or on one output as the observer reads it.

    Standard deviation ``size``, flat up to ``bandwidth`` [Hz] or a first-order low-pass with its ``corner`` [Hz], from
    ``seed``; see :class:`icmj.simulation.settings.Noise`.
    """

    kind: Literal["noise"]
    """Kind of the disturbance."""
    size: Positive | None = None
    """Standard deviation [unit of the input or output]; for a body, a factor on force and torque (default: 1)."""
    bandwidth: Positive | None = None
    """Upper end of a flat spectrum [Hz]; give either ``bandwidth`` or ``corner``."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
    """Seed of frequencies and phases."""
    start: NonNegative = 0.0
    """Start [s]."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""
    corner: Positive | None = None
    """Frequency at which a low-pass spectrum has fallen to half [Hz]."""
    terms: Annotated[int, Field(ge=1)] = NOISE_TERMS
    """Number of sinusoids of which the noise is the sum."""

    def source(self) -> Source:
        """The source that it stands for."""
        size, edge = (
            self.sized(self.size),
            (self.bandwidth, self.seed, self.start, self.output, self.corner, self.terms),
        )
        return Noise(self.input, size, *edge, **self.placed)


class GaussianTable(PlaceTable):
    """Gaussian noise on one input or body, or on one output as the observer reads it.

    White, or a first-order low-pass with its ``corner`` [Hz], exact in law at the points of a grid; see
    :class:`icmj.simulation.settings.Gaussian`.
    """

    kind: Literal["gaussian"]
    """Of the disturbance."""
    size: Positive | None = None
    """Standard deviation [unit of the input or output]; of a body times its force and torque, 1 by default."""
    corner: Positive | None = None
    """Where a low-pass spectrum has fallen to half [Hz]; white noise by default."""
    interval: Positive = GRID
    """Between its values, which straight lines join [s]; of several, whole multiples of the shortest."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
    """Of its values."""
    start: NonNegative = 0.0
    """From when on [s]."""
    output: str | None = None
    """The output that it acts on, by name, in place of an input or a body."""

    def source(self) -> Source:
        """The source that it stands for."""
        keys = ("input", "output", "corner", "interval", "seed", "start")
        return Gaussian(size=self.sized(self.size), **{key: getattr(self, key) for key in keys}, **self.placed)


class BiasTable(TomlTable):
    """A constant error of one output as the observer reads it: ``size`` from ``start`` [s] on."""

    kind: Literal["bias"]
    """Kind of the disturbance."""
    output: str
    """Name of the output."""
    size: Finite
    """Size of the error [unit of the output]."""
    start: NonNegative = 0.0
    """Start [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Bias(self.output, self.size, self.start)


class SinusoidsTable(PlaceTable):
    """A sum of sinusoids on one input or body, or on one output as the observer reads it.

    See :class:`icmj.simulation.settings.Sinusoids`. It is also how noise of a user's own code is recorded.
    """

    kind: Literal["sinusoids"]
    """Kind of the disturbance."""
    terms: Annotated[list[Annotated[list[Finite], Field(min_length=3, max_length=5)]], Field(max_length=MOST_TERMS)]
    """Terms [a, ω, φ] or [a, ω, φ, start, end] of a cos(ωt + φ) [unit; rad/s; rad; s]."""
    output: str | None = None
    """Name of the output, as the observer reads it."""
    made_by: Line = ""
    """Code that has drawn the terms, as module:name."""
    sha256: str = ""
    """Digest of its source file."""

    def source(self) -> Source:
        """The source that it stands for."""
        return Sinusoids(input=self.input, output=self.output, terms=tuple(map(tuple, self.terms)), **self.placed)


class OwnNoiseTable(PlaceTable):
    """Noise of one's own: the ``module:name`` of a function that draws the terms of its sum of sinusoids."""

    tag: ClassVar[str] = "own"

    kind: Reference
    """The function; it is given the parameters, and ``duration`` [s] if it takes one."""
    parameters: Parameters = {}
    """Of the function, by name; its seed among them."""
    output: str | None = None
    """Name of the output, as the observer reads it."""

    def source(self) -> None:
        """Nothing before its code has drawn it (:meth:`drawn`)."""

    def drawn(self, code: Code, duration: float) -> dict[str, Any]:
        """The table of kind ``sinusoids`` for a run of ``duration`` [s], whose terms ``code`` draws.

        Raises:
            RunFileError: if the code may not be run, fails, or draws no terms.
        """
        make = code.named(self.kind)
        told = code.made(self.kind, **{**accepted(make, {"duration": duration}), **self.parameters})
        try:
            terms = np.atleast_2d(np.asarray(told, dtype=float))
        except (TypeError, ValueError):
            terms = np.zeros((0, 0))
        if terms.ndim != 2 or terms.shape[1] not in (3, 5) or not len(terms):
            raise RunFileError(f"{self.kind}: expected rows (a, ω, φ) or (a, ω, φ, start, end), got {short(told)}")
        kept = self.model_dump(exclude={"kind", "parameters"}, exclude_unset=True, mode="json")
        drawn = {"terms": np.clip(terms, -LARGEST, LARGEST).tolist(), "made_by": self.kind, "sha256": digest_of(make)}
        return {**kept, "kind": "sinusoids", **drawn}


def _kind(table: Any) -> str | None:
    kind = table.get("kind") if isinstance(table, Mapping) else getattr(table, "kind", None)
    return "own" if isinstance(kind, str) and ":" in kind else None if kind is None else str(kind)


SourceTable = Annotated[
    Annotated[ImpulseTable, Tag("impulse")]
    | Annotated[StepTable, Tag("step")]
    | Annotated[NoiseTable, Tag("noise")]
    | Annotated[GaussianTable, Tag("gaussian")]
    | Annotated[BiasTable, Tag("bias")]
    | Annotated[SinusoidsTable, Tag("sinusoids")]
    | Annotated[OwnNoiseTable, Tag("own")],
    Discriminator(_kind),
]
"""A disturbance of a run file, by its ``kind``."""


class SimulationTable(TomlTable):
    """Duration, initial state and accuracy of a run; see :class:`icmj.simulation.Settings`."""

    duration: Annotated[Positive, Field(ge=SHORTEST, le=LONGEST)] = 30.0
    """Duration of the run [s]."""
    initial: dict[str, Finite] = {}
    """Initial departures of plant states from the operating point, by name; the others are zero."""
    observer: dict[str, Finite] = {}
    """Initial states of the observer, by name; the others are zero."""
    timestep: Positive | None = None
    """Timestep of the engine, instead of a tolerance [s]. The linear plant needs none."""
    integrator: Integrator | None = None
    """Integrator of the engine (default: that of the model)."""
    record_interval: Positive = 0.01
    """Time between recorded rows [s]; events are always recorded."""
    limit: Positive | dict[str, Positive] | None = None
    """Departure of a position at which the run counts as fallen: one number for all [rad or m, converted to other units
    of angle or length], or positions by name, each in its own unit. Default: 1 rad or 1 m; in plants given by matrices,
    positions with other units have no limit."""
    disturbance: Annotated[list[SourceTable], Field(max_length=MOST)] = []
    """Disturbances."""
    tolerance: Positive | None = None
    """Relative error of an open-loop interval to which the steps of the engine are adapted. Default, if neither
    timestep nor integrator is given: 10⁻⁸ if no contact, friction or limit can act; else the timestep of the model."""

    def settings(self) -> Settings:
        """The settings that it stands for.

        Raises:
            SimulationError: if they do not fit together.
        """
        plain = {name: getattr(self, name) for name in type(self).model_fields}
        sources = (table.source() for table in self.disturbance)
        return Settings(**plain | {"disturbance": tuple(source for source in sources if source is not None)})

    @model_validator(mode="before")
    @classmethod
    def _of_older_files(cls, data: Any) -> Any:
        """Accepts ``native = true`` of older files; it has no effect any more."""
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
    """Number of clock-driven simulations in panel (a) of the report."""
    law_q_t: Annotated[list[Positive], Field(max_length=MOST)] = []
    """Thresholds of the amplitude law, at least two [unit of ``controller.q_t``]."""
    attractor_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of random starts in the search for other attractors."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of these starts."""
    magnification: Positive = 10.0
    """Magnification of the sway in the second body of the viewer."""
    measures: Annotated[list[Reference], Field(max_length=MOST)] = []
    """Further measures: the ``module:name`` of functions that take a simulation and return numbers by name."""
