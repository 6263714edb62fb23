"""Disturbances of a run: impulses, steps, noise and biases, each with its place of action."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal, get_args

import numpy as np
from annotated_types import Ge, Len

from icmj.base.array import Array, Finite, NonNegative, Positive, Seed
from icmj.errors import SimulationError
from icmj.plant.linear_plant import ZERO, Push, Surface, Vector

NOISE_TERMS = 40  # sinusoids of one noise: enough for a nearly normal amplitude distribution
GRID = 0.01  # s, between two values of Gaussian noise: beyond 20 Hz a body does not follow
MOST_VALUES = 100_000  # of a sampled disturbance, which a log carries
MOST_TERMS = 2000  # sinusoids of one noise, each evaluated at every stage of a step
On = Literal["command", "body"]


@dataclass(frozen=True, kw_only=True)
class Placed:
    """The place at which a disturbance acts; subclasses define its course over time.

    Attributes:
        on: for a disturbance of an input: ``"command"``, it is added to the command, before input gain, gear and
            dynamics of the actuator; or ``"body"``, it acts on the body itself, along the joint or tendon that the
            input moves (:class:`icmj.plant.linear_plant.Push`).
        body: instead of an input, the body of a model that is pushed.
        force, torque: force and torque on the body for a size of 1 [N, N m], along the axes of the world.
        point: point of action of the force, in the body's frame [m]; its centre of mass if ``None``.
        surface, axis: instead of a body, a motion of the support surface, and its direction or axis; ``point`` is
            then on the axis of a ``turning`` (:class:`icmj.plant.linear_plant.Push`).
    """

    on: On = "body"
    body: str | None = None
    force: Vector = ZERO
    torque: Vector = ZERO
    point: Vector | None = None
    surface: Surface | None = None
    axis: Vector = ZERO

    @property
    def push(self) -> Push | None:
        """The place at which it acts on the plant itself; ``None`` if it acts on a command or on a reading."""
        if self.surface is not None:
            return Push(point=self.point, surface=self.surface, axis=self.axis)
        of: str | None = getattr(self, "input", None)
        if self.body is None and (self.on == "command" or of is None):
            return None
        return Push(of, self.body, self.force, self.torque, self.point)

    def _check_place(self) -> str:
        """Where it acts, and as what; SimulationError if that is not one place."""
        if (self.body or self.surface) and self.on == type(self).on == "command":  # not said
            object.__setattr__(self, "on", "body")
        what = _name(self)
        named = {key: getattr(self, key, None) for key in ("input", "output", "body", "surface")}
        there = [key for key, name in named.items() if name is not None]
        known = "input, output, body and surface" if hasattr(self, "output") else "input, body and surface"
        require(len(there) == 1, f"{what}: give one of {known}")
        require(self.on in get_args(On), f"{what}: on {self.on!r}; expected one of {', '.join(get_args(On))}")
        require(self.body is None or self.on == "body", f"{what} on body {self.body!r}: a body has no command")
        of_body = any(self.force) or any(self.torque) or (self.point is not None and self.surface is None)
        loose = self.body is None and of_body
        require(not loose, f"{what}: force, torque and point are those of a body; name it")
        return f"{what} on {str(self.push.where if self.push else named[there[0]])!r}"


@dataclass(frozen=True)
class Impulse(Placed):
    """An impulse, constant over its duration, on the body along an input, on the command, or on a body; see ``Placed``.

    Attributes:
        input: name of the input on which it acts, unless it acts on a ``body``.
        size: size of the impulse [N m s, or the unit of the input times s]. For a body, a factor on force and torque
            (default: 1).
        start: start [s].
        duration: duration [s].
    """

    input: str | None = None
    size: Finite = 1.0
    start: NonNegative = 0.0
    duration: Positive = 0.05

    def __post_init__(self) -> None:
        where = self._check_place()
        _check(self, where, "size", positive=("duration",))


@dataclass(frozen=True)
class Step(Placed):
    """A step, which acts where an impulse may act.

    Attributes:
        input: name of the input on which it acts, unless it acts on a ``body``.
        size: size of the step [N m, or the unit of the input]. For a body, a factor on force and torque (default: 1).
        start: start [s].
    """

    input: str | None = None
    size: Finite = 1.0
    start: NonNegative = 0.0

    def __post_init__(self) -> None:
        _check(self, self._check_place(), "size")


@dataclass(frozen=True)
class Noise(Placed):
    """Coloured noise on one input (process noise), or on one output as the observer reads it (sensor noise).

    On an input it is added to the command, like the noise of a muscle, unless ``on`` places it on the body; on a
    ``body`` it is one signal that multiplies its force and torque.

    Its spectrum is either flat up to ``bandwidth`` or a first-order low-pass with its ``corner``. Two noises with the
    same seed and spectrum are the same signal, apart from their size.

    Attributes:
        input: name of the input on which it acts, unless it acts on an ``output`` or a ``body``.
        size: standard deviation [unit of the input or output]. For a body, a factor on force and torque (default: 1).
        bandwidth: upper end of a flat spectrum [Hz]. Give either ``bandwidth`` or ``corner``.
        seed: seed of frequencies and phases.
        start: start [s].
        output: name of the output whose reading is disturbed, instead of an input or body.
        corner: frequency at which a low-pass spectrum has fallen to half [Hz]. The spectrum ends at twenty times that.
        terms: number of sinusoids of which the noise is the sum; with more of them the spectral lines are finer.
    """

    input: str | None = None
    size: Positive = 1.0
    bandwidth: Positive | None = None
    seed: Seed = 0
    start: NonNegative = 0.0
    output: str | None = None
    corner: Positive | None = None
    terms: Annotated[int, Ge(1)] = NOISE_TERMS
    on: On = field(default="command", kw_only=True)

    def __post_init__(self) -> None:
        where = self._check_place()
        require((self.bandwidth is None) != (self.corner is None), f"{where}: give one of bandwidth and corner")
        edge = "bandwidth" if self.corner is None else "corner"
        _check(self, where, positive=("size", edge))
        require(self.seed >= 0, f"{where}: seed {self.seed} is negative")
        require(1 <= self.terms <= MOST_TERMS, f"{where}: terms {self.terms}: expected between 1 and {MOST_TERMS}")


@dataclass(frozen=True, kw_only=True)
class Sinusoids(Placed):
    """A sum of sinusoids Σ a cos(ωt + φ), in the same places as :class:`Noise`; noise from user code has this form.

    Attributes:
        input: name of the input on which it acts, unless it acts on an ``output`` or a ``body``.
        output: name of the output whose reading is disturbed, instead of an input or body.
        terms: terms (a, ω, φ), or (a, ω, φ, start, end), which acts from ``start`` to ``end`` only, of a cos(ωt + φ)
            [unit; rad/s; rad; s].
    """

    input: str | None = None
    output: str | None = None
    terms: Annotated[tuple[Annotated[tuple[Finite, ...], Len(3, 5)], ...], Len(0, MOST_TERMS)]
    on: On = "command"

    def __post_init__(self) -> None:
        where = self._check_place()
        object.__setattr__(self, "terms", tuple(tuple(map(float, term)) for term in self.terms))
        count = len(self.terms)
        require(1 <= count <= MOST_TERMS, f"{where}: {count} terms: expected between 1 and {MOST_TERMS}")
        for term in self.terms:
            size = len(term)
            require(size in (3, 5), f"{where}: a term is (a, ω, φ) or (a, ω, φ, start, end), got {size} numbers")
            require(bool(np.isfinite(term[:4]).all()), f"{where}: a, ω, φ and start must be finite, got {term}")
            require(term[1] >= 0, f"{where}: ω {term[1]} rad/s is negative")
            require(size == 3 or 0 <= term[3] < term[4], f"{where}: a term is to act from a start ≥ 0 to a later end")


@dataclass(frozen=True)
class Bias:
    """A constant error of the observer's reading of an output.

    Attributes:
        output: name of the output.
        size: size of the error [unit of the output].
        start: start [s].
    """

    output: str
    size: Finite
    start: NonNegative = 0.0

    def __post_init__(self) -> None:
        _check(self, f"bias on {self.output!r}", "size")


@dataclass(frozen=True, kw_only=True)
class Gridded(Placed):
    """A disturbance given by its values at the points of a regular time grid from t = 0 on, and linear between them.

    Attributes:
        input: name of the input on which it acts, unless it acts on an ``output`` or a ``body``.
        output: name of the output whose reading is disturbed, instead of an input or body.
        interval: distance between the points of the grid [s]. Those of several grids must be integer multiples of the
            shortest.
        start: time before which it is zero [s].
    """

    input: str | None = None
    output: str | None = None
    interval: Positive = GRID
    start: NonNegative = 0.0

    def _check_grid(self, *positive: str) -> str:
        """Check the place, the grid and other positive numbers; SimulationError if one is wrong."""
        where = self._check_place()
        _check(self, where, positive=("interval", *positive))
        return where


@dataclass(frozen=True, kw_only=True)
class Gaussian(Gridded):
    """Gaussian noise on a regular time grid, in the same places as :class:`Noise`, for fits and for runs of any length.

    At the points of the grid its distribution is exact; between them it is linear. The place, ``interval`` and
    ``start`` are those of :class:`icmj.simulation.settings.Gridded`.

    Attributes:
        size: standard deviation at the points of the grid [unit of the input or output]. For a body, a factor on force
            and torque (default: 1).
        corner: frequency at which a first-order low-pass spectrum has fallen to half [Hz]. By default, the noise is
            white: its values are independent, with the density 2 size² interval [unit²/Hz] far below 1 / interval.
        seed: seed of the values.
        share: instead of a size, for an ``input``: the standard deviation as a share of the controller's command u(t)
            to it (signal-dependent noise). The noise is share · u(t) · ξ(t), where ξ has the variance one at the points
            of the grid; u is the command's departure from the operating point as it acts, after the controller's delay
            and before gain, gear and dynamics of the actuator. 0 for noise of constant size.
    """

    size: Positive = 1.0
    corner: Positive | None = None
    seed: Seed = 0
    share: float = 0.0
    on: On = "command"

    def __post_init__(self) -> None:
        where = self._check_grid("size", *(["corner"] if self.corner is not None else []))
        require(self.seed >= 0, f"{where}: seed {self.seed} is negative")
        require(0 <= self.share < np.inf, f"{where}: share {self.share} must be positive and finite")
        if self.share:
            require(self.size == 1, f"{where}: give size or share, not both")
            commanded = self.input is not None and self.on == "command"
            require(commanded, f"{where}: a share is of a command; give input, and on = 'command' or no on")


@dataclass(frozen=True, kw_only=True)
class Sampled(Gridded):
    """A disturbance of any course, by its values: a ramp, or a recording; in the same places as :class:`Noise`.

    The place, ``interval`` and ``start`` are those of :class:`icmj.simulation.settings.Gridded`.

    Attributes:
        values: values at the points of the grid [unit of the disturbed signal]. After the last point, its value is
            held. For a body, factors on force and torque.
    """

    values: Annotated[tuple[Finite, ...], Len(1, MOST_VALUES)]

    def __post_init__(self) -> None:
        where = self._check_grid()
        require(0 < len(self.values) <= MOST_VALUES, f"{where}: {len(self.values)} values; expected 1 to {MOST_VALUES}")
        require(bool(np.isfinite(self.at_points).all()), f"{where}: the values must be finite")

    @cached_property
    def at_points(self) -> Array:
        """The values as an array."""
        return np.array(self.values, dtype=float)


Source = Impulse | Step | Noise | Bias | Gaussian | Sampled | Sinusoids
"""One source of disturbance."""


def _name(source: object) -> str:
    """What it is called, as its kind in a run file is."""
    return type(source).__name__.lower()


_UNITS = {"bandwidth": " Hz", "corner": " Hz", "interval": " s", "duration": " s"}


def _check(
    source: Impulse | Step | Noise | Bias | Gridded, where: str, *names: str, positive: Sequence[str] = ()
) -> None:
    """Check that these numbers and the start are finite, ``positive`` ones positive, and that it starts at t ≥ 0."""
    for name in (*names, *positive, "start"):
        value = getattr(source, name)
        require(bool(np.isfinite(value)), f"{_name(source)}: {name} must be finite, got {value}")
        good = value > 0 or name not in positive
        require(good, f"{where}: {name} {value}{_UNITS.get(name, '')} must be positive")
    require(source.start >= 0, f"{where}: start {source.start} s is negative")


def require(good: bool, otherwise: str) -> None:
    """Raise an error for invalid settings.

    Raises:
        SimulationError: ``otherwise``, if they are not.
    """
    if not good:
        raise SimulationError(otherwise)
