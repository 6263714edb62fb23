"""The settings of a run: duration, initial state, step or tolerance, and disturbances; and where it starts by them.

Disturbances of a run: impulses, steps, noise and biases, each with its place of action.

Disturbances on a regular time grid, linear between its points: Gaussian noise, exact in law, and given values.

White noise has independent values; a first-order low-pass is an Ornstein–Uhlenbeck process, x_{k+1} = a x_k +
√(1 − a²) ξ_k with a = exp(−2π f_c Δ), which at the points of the grid is the continuous one's own law. It is a function
of time, so that it acts alike whatever steps are taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Annotated, Literal, get_args

import numpy as np
from annotated_types import Ge, Le, Len
from numpy.typing import ArrayLike

from icmj.base.array import Array, Finite, NonNegative, Positive, Seed, since
from icmj.controller.controller import Controller, start_state
from icmj.errors import SimulationError
from icmj.plant.linear_plant import ZERO, LinearPlant, Push, Surface, Vector
from icmj.simulation.position_limit import Limit

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

    def _check_place(self, what: str) -> str:
        """The name of where it acts; SimulationError if that is not one place."""
        named = {key: getattr(self, key, None) for key in ("input", "output", "body", "surface")}
        there = [key for key, name in named.items() if name is not None]
        known = "input, output, body and surface" if hasattr(self, "output") else "input, body and surface"
        require(len(there) == 1, f"{what}: give one of {known}")
        require(self.on in get_args(On), f"{what}: on {self.on!r}; expected one of {', '.join(get_args(On))}")
        require(self.body is None or self.on == "body", f"{what} on body {self.body!r}: a body has no command")
        of_body = any(self.force) or any(self.torque) or (self.point is not None and self.surface is None)
        loose = self.body is None and of_body
        require(not loose, f"{what}: force, torque and point are those of a body; name it")
        return str(self.push.where if self.push else named[there[0]])


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
        where = self._check_place("impulse")
        _check(self, "impulse", "size", "start", "duration")
        require(self.start >= 0, f"impulse on {where!r}: start {self.start} s is negative")
        require(self.duration > 0, f"impulse on {where!r}: duration {self.duration} s must be positive")


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
        where = self._check_place("step")
        _check(self, "step", "size", "start")
        require(self.start >= 0, f"step on {where!r}: start {self.start} s is negative")


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
        if (self.body or self.surface) and self.on == "command":  # not said
            object.__setattr__(self, "on", "body")
        where = f"noise on {self._check_place('noise')!r}"
        require((self.bandwidth is None) != (self.corner is None), f"{where}: give one of bandwidth and corner")
        edge = "bandwidth" if self.corner is None else "corner"
        _check(self, "noise", "size", edge, "start")
        require(self.size > 0, f"{where}: size {self.size} must be positive")
        require(getattr(self, edge) > 0, f"{where}: {edge} {getattr(self, edge)} Hz must be positive")
        require(self.seed >= 0, f"{where}: seed {self.seed} is negative")
        require(self.start >= 0, f"{where}: start {self.start} s is negative")
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
        if (self.body or self.surface) and self.on == "command":  # not said
            object.__setattr__(self, "on", "body")
        where = f"sinusoids on {self._check_place('sinusoids')!r}"
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
        _check(self, "bias", "size", "start")
        require(self.start >= 0, f"bias on {self.output!r}: start {self.start} s is negative")


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

    def _check_grid(self, what: str, *names: str) -> str:
        """Check the place and the grid; SimulationError if one is wrong."""
        where = f"{what} on {self._check_place(what)!r}"
        _check(self, what, *names, "interval", "start")
        require(self.interval > 0, f"{where}: interval {self.interval} s must be positive")
        require(self.start >= 0, f"{where}: start {self.start} s is negative")
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
        if (self.body or self.surface) and self.on == "command":  # not said
            object.__setattr__(self, "on", "body")
        where = self._check_grid("gaussian noise", "size", *(["corner"] if self.corner is not None else []))
        require(self.size > 0, f"{where}: size {self.size} must be positive")
        require(self.corner is None or self.corner > 0, f"{where}: corner {self.corner} Hz must be positive")
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
        where = self._check_grid("sampled disturbance")
        require(0 < len(self.values) <= MOST_VALUES, f"{where}: {len(self.values)} values; expected 1 to {MOST_VALUES}")
        require(bool(np.isfinite(self.at_points).all()), f"{where}: the values must be finite")

    @cached_property
    def at_points(self) -> Array:
        """The values as an array."""
        return np.array(self.values, dtype=float)


Source = Impulse | Step | Noise | Bias | Gaussian | Sampled | Sinusoids
"""One source of disturbance."""


def _check(source: object, what: str, *names: str) -> None:
    for name in names:
        value = getattr(source, name)
        require(bool(np.isfinite(value)), f"{what}: {name} must be finite, got {value}")


def require(good: bool, otherwise: str) -> None:
    """Raise an error for invalid settings.

    Raises:
        SimulationError: ``otherwise``, if they are not.
    """
    if not good:
        raise SimulationError(otherwise)


_SAME = 1e-9  # of an interval: points of a grid nearer to an edge are that edge
_BLOCK, _BLOCKS = 256, 16  # points that are worked out at once: as many whatever the run's length, to the last bit


def at_points(source: Gridded, first: int, last: int) -> Array:
    """The values at points ``first`` to ``last`` − 1 of its grid, counted from zero [its unit, or of a command: 1]."""
    if isinstance(source, Sampled):
        held = source.at_points
        return np.asarray(held[np.minimum(np.arange(first, last), len(held) - 1)])
    assert isinstance(source, Gaussian)
    count = -(-last // (_BLOCK * _BLOCKS))
    values = _draw(source.seed, _memory(source), 1 << max(count - 1, 0).bit_length())[first:last]
    return (source.share or source.size) * values


def at_times(source: Gridded, t: Array) -> Array:
    """The value of the noise at any times [s], zero before its start."""
    if not t.size:
        return np.zeros(t.shape)
    place = np.maximum(t, 0) / source.interval
    point = np.floor(place).astype(int)
    values = at_points(source, 0, int(point.max()) + 2)
    between = values[point] + (place - point) * (values[point + 1] - values[point])
    return np.asarray(np.where(since(t, source.start), between, 0.0))


def lines(sources: Sequence[Gridded], duration: float) -> tuple[Array, Array]:
    """Disturbances in a run of ``duration`` [s] as straight lines, on stretches that all share.

    Returns:
        where each stretch but the first begins [s], and infinity, shape (K,); the value at its begin and the slope of
        each source there, shape (K, S, 2).
    """
    starts = np.unique([source.start for source in sources if 0 < source.start < duration])
    begins = np.append(0.0, points_between(starts, sources, duration))
    after = begins[-1] + 1e-3 * min(source.interval for source in sources)  # in the same interval as the last begin
    middle, found = begins + np.diff(begins, append=after) / 2, np.zeros((len(begins), len(sources), 2))
    for number, source in enumerate(sources):
        point = np.floor(middle / source.interval).astype(int)
        values = at_points(source, 0, int(point.max(initial=0)) + 2)
        slope = np.where(middle >= source.start, np.diff(values)[point] / source.interval, 0.0)
        found[:, number, 1] = slope
        there = np.where(middle >= source.start, values[point], 0.0)
        found[:, number, 0] = there + slope * (begins - point * source.interval)
    return np.append(begins[1:], np.inf), found


def _memory(source: Gaussian) -> float:
    """The correlation a of values at successive grid points."""
    return 0.0 if source.corner is None else float(np.exp(-2 * np.pi * source.corner * source.interval))


@lru_cache(maxsize=8)  # of up to 16 MB
def _draw(seed: int, a: float, parts: int) -> Array:
    """Random values of variance one for a number of grid intervals."""
    random = np.random.default_rng(seed)
    fresh = random.standard_normal(parts * _BLOCKS * _BLOCK).reshape(parts, _BLOCKS, _BLOCK)
    if a == 0:
        return fresh.ravel()
    left = _left(a)
    fresh *= np.sqrt(1 - a**2)
    fresh[0, 0, 0] /= np.sqrt(1 - a**2)  # it has been going on for ever
    found, last = np.empty_like(fresh), 0.0
    for part in range(parts):
        found[part] = (left @ fresh[part].T).T
        for block in found[part]:
            block += a * left[:, 0] * last
            last = float(block[-1])
    return found.ravel()


@lru_cache(maxsize=16)
def _left(a: float) -> Array:
    """The contribution of each point of a block to each other point, shape (256, 256)."""
    order = np.arange(_BLOCK)
    since = order[:, None] - order
    return np.where(since >= 0, (a ** order.astype(float))[np.abs(since)], 0.0)


def points_of(source: Gridded, duration: float) -> int:
    """Number of points of its grid that a run of ``duration`` [s] takes, one beyond the end with it."""
    return int(duration / source.interval * (1 + 1e-12)) + 2


def points_between(edges: Array, noises: Sequence[Gridded], duration: float) -> Array:
    """The points of the finest of these grids in a run, where they bend, among ``edges``; rising [s]."""
    if not noises:
        return edges
    finest = min(noises, key=lambda noise: noise.interval)
    points = finest.interval * np.arange(1, points_of(finest, duration) - 1)
    place = np.searchsorted(edges, points)
    beside = np.r_[-np.inf, edges, np.inf]
    alone = np.minimum(points - beside[place], beside[place + 1] - points) > _SAME * finest.interval
    return np.union1d(edges, points[alone])


MOST_ROWS = 2e6  # some hundred bytes each, in memory and in the log
LEAST_TOLERANCE, MOST_TOLERANCE = 1e-13, 0.1  # below is rounding, above nothing is told of the motion
Duration = Annotated[Positive, Ge(1e-6), Le(1e9)]  # s, up to thirty years: the viewer counts nanoseconds in 64 bits
Integrator = Literal["RK4", "Euler", "implicit", "implicitfast", "discrete"]


@dataclass(frozen=True)
class Settings:
    """The settings of a simulation, for either plant.

    Attributes:
        duration: duration of the run [s].
        initial: initial deviations of plant states from the operating point, by name; the others are zero.
        observer: initial states of the observer, by name; the others are zero, because the controller has no
            information yet.
        timestep: timestep in MuJoCo, instead of a tolerance [s]. The linear plant needs none.
        integrator: integrator in MuJoCo (default: that of the model).
        record_interval: time between recorded rows [s], which are at its multiples. Events are always recorded.
        limit: deviation of a position from the operating point at which the run counts as fallen: one number for all
            [rad or m, converted to other units of angle or length], or positions by name, each in its own unit.
            Default: 1 rad or 1 m; in plants given by matrices, positions with other units have no limit.
        disturbance: disturbances of inputs, of bodies, or of the observer's readings of outputs.
        tolerance: relative error of an open-loop interval for which the timestep in MuJoCo is chosen. Default, if
            neither timestep nor integrator is given: 10⁻⁸ if no contact, friction or limit can act; else the timestep
            of the model.

    Raises:
        SimulationError: on construction, if a number is out of range, or the run would have too many rows.
    """

    duration: Duration = 30.0
    initial: Mapping[str, Finite] = field(default_factory=dict)
    observer: Mapping[str, Finite] = field(default_factory=dict)
    timestep: Positive | None = None
    integrator: Integrator | None = None
    record_interval: Positive = 0.01
    limit: Limit = None
    disturbance: tuple[Source, ...] = ()
    tolerance: Positive | None = None

    @property
    def pushes(self) -> tuple[Push, ...]:
        """The places at which disturbances act on the plant itself, each once."""
        found = (source.push for source in self.disturbance if isinstance(source, Placed))
        return tuple(dict.fromkeys(push for push in found if push is not None))

    @property
    def noisy(self) -> bool:
        """Whether noise acts, so that a run is described by its statistics."""
        return any(isinstance(source, Noise | Gaussian | Sinusoids) for source in self.disturbance)

    @property
    def share_interval(self) -> float:
        """Shortest interval of noises whose size is a share of the command [s]; 0 if there are none."""
        noises = (source for source in self.disturbance if isinstance(source, Gaussian) and source.share)
        return min((noise.interval for noise in noises), default=0.0)

    def __post_init__(self) -> None:
        named = self.limit if isinstance(self.limit, Mapping) else {"limit": self.limit}
        limits = {name if name == "limit" else f"limit.{name}": value for name, value in named.items()}
        plain = {name: getattr(self, name) for name in ("duration", "record_interval", "timestep")}
        for name, value in (plain | limits).items():
            good = value is None and name in ("timestep", "limit")
            good = good or (value is not None and bool(np.isfinite(value)) and value > 0)
            require(good, f"{name} must be positive and finite, got {value}")
        for which in ("initial", "observer"):
            for name, value in getattr(self, which).items():
                require(np.isfinite(value), f"{which}.{name} must be finite, got {value}")
        known = get_args(Integrator)
        require(
            self.integrator is None or self.integrator in known,
            f"no integrator {self.integrator!r}; expected one of {', '.join(known)}",
        )
        fixed = " and ".join(name for name in ("timestep", "integrator") if getattr(self, name) is not None)
        if self.tolerance is not None:
            require(not fixed, f"give tolerance, or {fixed}, not both: a tolerance chooses steps and integrator")
            known_range = f"expected between {LEAST_TOLERANCE:g} and {MOST_TOLERANCE:g}"
            good = LEAST_TOLERANCE <= self.tolerance <= MOST_TOLERANCE
            require(good, f"tolerance {self.tolerance}: {known_range}")
        object.__setattr__(self, "disturbance", tuple(self.disturbance))
        grids = [source.interval for source in self.disturbance if isinstance(source, Gridded)]
        for interval in grids:
            times = interval / min(grids)
            require(
                abs(times - round(times)) < 1e-9 * times,
                f"gaussian and sampled disturbances: intervals of {min(grids):g} and {interval:g} s; give whole "
                "multiples of the shortest",
            )
            points = self.duration / interval
            require(
                points <= MOST_ROWS,
                f"gaussian or sampled disturbance: {points:.3g} values, {interval:g} s apart; expected at most "
                f"{MOST_ROWS:.0e}",
            )
        rows = self.duration / self.record_interval
        require(
            rows <= MOST_ROWS,
            f"duration / record_interval asks for {rows:.3g} rows; expected at most {MOST_ROWS:.0e}, "
            "raise record_interval",
        )


def reseed(settings: Settings, seed: int) -> Settings:
    """The settings with other noise: each noise's seed is made of its own seed and this one."""
    sources = tuple(
        replace(of, seed=int(np.random.SeedSequence((of.seed, seed)).generate_state(1, np.uint64)[0] >> np.uint64(1)))
        if isinstance(of, Noise | Gaussian)
        else of
        for of in settings.disturbance
    )
    return replace(settings, disturbance=sources)


def start_states(
    plant: LinearPlant,
    controller: Controller,
    settings: Settings,
    x: ArrayLike | None = None,
    x_o: ArrayLike | None = None,
    x_h: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """The states at t = 0: of the plant, shape (n,), and of the controller, in its layout.

    Args:
        plant: the actual plant, or its linearisation.
        controller: says which states it has.
        settings: names the states that do not start at zero.
        x, x_o, x_h: whole vectors instead; the hold starts where the observer does if ``x_h`` is ``None``, because
            t = 0 is an event.

    Raises:
        SimulationError: if a named state does not exist, or a vector has the wrong shape or is not finite.
    """
    if controller.delay.t_d >= settings.duration:
        raise SimulationError(
            f"the delay of {controller.delay.t_d:g} s is not shorter than the run of {settings.duration:g} s: "
            "no event would ever act"
        )
    assumed = controller.design.plant.states
    plant_state = plant_start(plant, settings, x)
    observer = _start("observer", assumed, settings.observer, x_o)
    hold = observer if x_h is None else _start("hold", assumed, {}, x_h)
    return plant_state, start_state(controller, observer, hold)


def plant_start(plant: LinearPlant, settings: Settings, x: ArrayLike | None = None) -> Array:
    """The plant's state at t = 0, shape (n,), by name or as a whole vector.

    Raises:
        SimulationError: as for :func:`start_states`.
    """
    return _start("plant", plant.states, settings.initial, x)


def _start(what: str, names: Sequence[str], named: Mapping[str, float], given: ArrayLike | None) -> Array:
    if given is not None:
        state = np.array(given, dtype=float)
        if state.shape != (len(names),) or not np.isfinite(state).all():
            raise SimulationError(f"start state of the {what}: expected {len(names)} finite numbers, got {state}")
        return state
    for name in named:
        if name not in names:
            raise SimulationError(f"start state of the {what}: no state {name!r}; its states are {', '.join(names)}")
    return np.array([named.get(name, 0.0) for name in names], dtype=float)
