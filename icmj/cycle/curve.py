"""The curve of cycles over a parameter: the parameter, the equation of the curve, and its points.

A continuation parameter: a common name or a key of the run file, how its value is set, and the loops along it.

Each loop reuses the parts of the previous one that have not changed.

The curve of cycles: the equation that they satisfy in a state and a parameter, both scaled to be of order one.

A point of it is u = (w, σ). w is z relative to the size of each state and of the threshold, so that on the linear plant
it does not change with q_t; σ runs from 0 to 1 between the ends of the range, by the logarithm of the parameter where
that range spans a decade. Lengths are
measured by |w|²/N + σ², w by its size where that has grown.

Onto it leads a quasi-Newton method on the equation and a condition along the curve.

One cycle of a branch with its results: multipliers, trajectories of its intervals, distance from grazing.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, falling
from icmj.case.case import Case, expect_theory
from icmj.case.control import make_design, parts_of
from icmj.case.iosystem import AnyPlant
from icmj.case.plants import actual_plant, assumed_plant, linear_plant
from icmj.cycle.cycle import extent
from icmj.cycle.return_map import LostInterval, PlantKind, ReturnMap, Turn, courses_of, fast_jacobian
from icmj.engine.open_loop import OpenLoops
from icmj.engine.plant import MujocoPlant
from icmj.errors import CycleError
from icmj.plant.body import What
from icmj.runfile.schema import RunFile
from icmj.simulation.open_loop import Sample

KEYS = {
    "b": ("actual.gain",),
    "q_t": ("controller.q_t",),
    "delay": ("assumed.delay", "actual.delay"),
    "delta_min": ("controller.delta_min",),
    "rho": ("actual.rho",),
}
"""What the names stand for."""

_UNITS = {"delay": "s", "delta_min": "s"}  # that of q_t is the controller's
ROWS = 4800  # that the longest flight would keep; intervals last a twelfth to a fiftieth of it


def unit_of(name: str) -> str:
    """The unit of a parameter where it has one that is known."""
    return _UNITS.get(name, "")


def with_unit(name: str) -> str:
    """The name of a parameter, with its unit in brackets where it has one that is known."""
    return f"{name} ({_UNITS[name]})" if name in _UNITS else name


@dataclass(frozen=True)
class Parameter:
    """One number of a run file.

    Attributes:
        name: as it was asked for: one of :data:`KEYS`; a named change such as ``mass:trunk``, whose value is a factor;
            or a dotted key.
        keys: of the run file that take its value; none for a named change.
    """

    name: str
    keys: tuple[str, ...]

    def put(self, run: RunFile, value: float) -> RunFile:
        """The run file with this value.

        Raises:
            RunFileError: if it does not allow it.
        """
        if self.keys:
            return run.with_(**dict.fromkeys(self.keys, value))
        what, _, of = self.name.partition(":")
        changes = [entry.model_dump(exclude_none=True) for entry in run.actual.change]
        mine = {"what": what, **({"of": of} if of else {})}
        others = [entry for entry in changes if {k: entry.get(k) for k in mine} != mine or "value" in entry]
        return run.with_(**{"actual.change": [*others, {**mine, "factor": value}]})

    def value(self, run: RunFile) -> float:
        """The run file's own value.

        Raises:
            CycleError: if it has none, or not one number.
        """
        if not self.keys:
            what, _, of = self.name.partition(":")
            for entry in run.actual.changes:
                if entry.what == what and (entry.of or "") == of and entry.factor is not None:
                    return float(entry.factor)
            return 1.0
        found: Any = run
        for part in self.keys[0].split("."):
            if not isinstance(found, dict) and not hasattr(found, part):
                raise CycleError(f"{run.path}: has no key {self.keys[0]!r} that is one number")
            found = found.get(part) if isinstance(found, dict) else getattr(found, part)
        if found is None:
            raise CycleError(f"{run.path}: does not set {self.name}; say where to begin, with --from")
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise CycleError(f"{run.path}: {self.name} is {found!r} there; a parameter is one number")
        return float(found)


def parameter(name: str) -> Parameter:
    """The parameter of a name.

    Raises:
        CycleError: if there is none.
    """
    if name in KEYS:
        return Parameter(name, KEYS[name])
    if name.partition(":")[0] in get_args(What):
        return Parameter(name, ())
    if "." in name:
        return Parameter(name, (name,))
    known = ", ".join(KEYS)
    raise CycleError(
        f"no parameter {name!r}; expected one of {known}, a change such as mass:trunk, or a key such as design.R_c"
    )


class ReturnMaps:
    """Return maps of a run file as a function of a parameter, without the prediction, which would cost time.

    Attributes:
        run, parameter, plant: what of.
        built: how many loops were built.
    """

    def __init__(
        self, run: RunFile, parameter: Parameter, plant: PlantKind = "mujoco", like: Case | None = None
    ) -> None:
        """Create the family; plants and design of the case ``like`` are reused."""
        self.run, self.parameter, self.plant = run, parameter, plant
        self.built = 0
        self.held = any(key.endswith(".delay") for key in parameter.keys)  # one z along the branch, whatever the delay
        self._loops = OpenLoops()
        self._known: dict[str, tuple[Any, Any]] = {}
        if like is not None and like.run == run and like.run.path == run.path:
            self._known = {
                "assumed": (self._bare(run), like.assumed),
                "actual": (self._bodies(run), like.actual),
                "design": ((self._bare(run), run.design), expect_theory(like, "a branch").system.design),
            }

    def at(self, value: float, longest: float | None = None) -> ReturnMap:
        """The return map at a value.

        Args:
            value: of the parameter.
            longest: flight [s]; the run file's duration by default.

        Raises:
            IcmjError: if the run file does not allow the value, or there is no loop of it.
        """
        run = self.parameter.put(self.run, value)
        self.built += 1
        assumed = self._assumed(run)
        actual: AnyPlant = self._once(
            "actual", self._bodies(run), lambda: self._regain(run) or actual_plant(run, assumed)
        )
        weights = (self._bare(run), run.design)
        design = self._once("design", weights, lambda: make_design(assumed.linearisation.plant, run.design))
        controller = replace(run.intermittent.law(parts_of(run, assumed.linearisation.plant, design)), setpoint=None)
        settings = run.resolve().simulation.settings()
        if longest is not None:
            settings = replace(settings, duration=longest)
        if self.plant == "linear":
            return ReturnMap(linear_plant(actual, settings), controller, settings, held=self.held)
        if not isinstance(actual, MujocoPlant):
            raise CycleError(f"{run.path}: the actual plant is given by matrices; take the linear plant")
        every = np.inf if longest is None else longest / ROWS
        return ReturnMap(actual, controller, settings, every, self._loops, self.held)

    def _regain(self, run: RunFile) -> MujocoPlant | None:
        """The last actual plant with another input gain, if that is all that differs: its point and model stay."""
        if "actual" not in self._known:
            return None
        (assumed, actual), plant = self._known["actual"]
        before, after = actual.gain, run.actual.gain
        same = assumed == run.assumed and actual == run.actual.model_copy(update={"delay": None, "gain": before})
        plain = isinstance(before, float) and isinstance(after, float) and before != 0 and run.actual.rho == 1.0
        gains = any(entry.what == "input_gain" for entry in run.actual.changes)
        if not (same and plain and not gains and isinstance(plant, MujocoPlant)):
            return None
        here, factor = plant.linearisation, after / before
        turned = replace(here, plant=here.plant.scaled(factor), ports=replace(here.ports, b=here.ports.b * factor))
        return replace(plant, linearisation=replace(turned, D=here.D * factor))

    def _assumed(self, run: RunFile) -> AnyPlant:
        plant: AnyPlant = self._once("assumed", self._bare(run), lambda: assumed_plant(run))
        return plant

    @staticmethod
    def _bare(run: RunFile) -> Any:
        return run.assumed.model_copy(update={"delay": 0.0})

    @staticmethod
    def _bodies(run: RunFile) -> Any:
        return run.assumed, run.actual.model_copy(update={"delay": None})

    def _once(self, what: str, made_of: Any, make: Any) -> Any:
        if what not in self._known or self._known[what][0] != made_of:
            self._known[what] = made_of, make()
        return self._known[what][1]


_KEPT = 6  # loops at hand, by their parameter
CLOSED = 1e-10  # relative closure
_AT_ONCE = 1e-10  # closure of a prediction that needs no step
_LAST = 1e-5  # a step that is no longer than this is believed without a flight
_MOST = 9  # steps
_FAR = 0.5  # a step longer than this, in units of the state's size, has lost the curve


@dataclass(frozen=True)
class Range:
    """The range of a parameter and its scaling.

    Attributes:
        start, end: its values at σ = 0 and σ = 1.
    """

    start: float
    end: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.start) and np.isfinite(self.end) and self.start != self.end):
            raise CycleError(f"a branch runs between two different values, got {self.start:g} and {self.end:g}")

    @property
    def logarithmic(self) -> bool:
        """Whether it spans a decade or more."""
        return min(self.start, self.end) > 0 and not 0.1 < self.start / self.end < 10

    def value(self, sigma: float) -> float:
        """The parameter value at the scaled parameter σ."""
        if sigma in (0.0, 1.0):
            return self.end if sigma else self.start
        if self.logarithmic:
            return float(np.exp(np.log(self.start) + sigma * np.log(self.end / self.start)))
        return self.start + sigma * (self.end - self.start)

    def sigma(self, value: float) -> float:
        """The scaled parameter σ of a parameter value."""
        if self.logarithmic:
            return float(np.log(value / self.start) / np.log(self.end / self.start))
        return (value - self.start) / (self.end - self.start)

    def slope(self, sigma: float) -> float:
        """d value / dσ."""
        width = self.end - self.start
        return self.value(sigma) * float(np.log(self.end / self.start)) if self.logarithmic else width


class Curve:
    """sign · P^p(z; λ) = z as an equation in u.

    Attributes:
        family: loops by λ.
        range: of λ.
        p, sign: what closes after how many intervals.
        scale: of z at the threshold ``size``, shape (N,).
        flights: how many intervals were flown.
    """

    def __init__(self, family: ReturnMaps, over: Range, p: int, sign: int, scale: Array, size: float) -> None:
        self.family, self.range, self.p, self.sign = family, over, p, sign
        self.scale, self.size = scale, size
        self.longest, self.weight = 0.0, 1.0
        self.flights = 0
        self._loops: OrderedDict[tuple[float, float], ReturnMap] = OrderedDict()

    def loop(self, sigma: float) -> ReturnMap:
        """The return map at σ."""
        key = (self.range.value(sigma), self.longest)
        if key not in self._loops:
            self._loops[key] = self.family.at(key[0], self.longest or None)
            while len(self._loops) > _KEPT:
                self._loops.popitem(last=False)
        return self._loops[key]

    def patient(self, interval: float) -> None:
        """Set the longest allowed interval of a simulation to a multiple of the longest ``interval`` so far [s]."""
        if not 3 * interval < self.longest < 50 * interval:
            self.longest = 12 * interval

    def unit(self, loop: ReturnMap) -> Array:
        """The scale of z at the threshold of a loop."""
        return self.scale * (getattr(loop.controller.trigger, "size", self.size) / self.size)

    def z(self, u: Array) -> Array:
        """The state z of a scaled point u."""
        return np.asarray(u[:-1] * self.unit(self.loop(u[-1])))

    def u(self, z: Array, sigma: float) -> Array:
        """The scaled point u of a state z."""
        return np.append(z / self.unit(self.loop(sigma)), sigma)

    def residual(self, u: Array) -> tuple[Array, Turn]:
        """sign · P^p(z) − z relative to its unit, and the turn.

        Raises:
            Lost: if a flight does not come to an event.
        """
        loop = self.loop(float(u[-1]))
        unit = self.unit(loop)
        turn = loop.turn(u[:-1] * unit, self.p)
        self.flights += self.p
        return self.sign * turn.end / unit - u[:-1], turn

    def weigh(self, u: Array) -> None:
        """Scale steps in the state by its size at a point, so that the arc length does not grow with the amplitude."""
        self.weight = max(1.0, float(np.abs(u[:-1]).max()))

    def length(self, du: Array) -> float:
        """Length of a step."""
        return float(np.sqrt(((du[:-1] / self.weight) ** 2).mean() + du[-1] ** 2))

    def normal(self, tangent: Array) -> Array:
        """The row that measures along a tangent."""
        return np.append(tangent[:-1] / (len(tangent) - 1) / self.weight**2, tangent[-1])

    def turn_of(self, before: Array, after: Array) -> float:
        """Cosine of the angle between two steps."""
        return float(self.normal(before) @ after / max(self.length(before) * self.length(after), 1e-300))


@dataclass(frozen=True, eq=False)
class Correction:
    """A point on the curve.

    Attributes:
        u: the point, as it was flown.
        best: the point by what that flight has shown, which none has flown.
        turn: its intervals.
        closure: largest entry of the residual.
        D: derivative of the residual, with Broyden's updates, shape (N, N + 1).
        steps: that it took.
    """

    u: Array
    best: Array
    turn: Turn
    closure: float
    D: Array
    steps: int


@dataclass(frozen=True, eq=False)
class Miss:
    """No point was found, and the last reason why.

    Attributes:
        lost: the flight that did not come back, or ``None``.
        turn: the last one, or ``None``.
    """

    lost: LostInterval | None
    turn: Turn | None


def correct(curve: Curve, u: Array, D: Array, row: Array, closed: float = CLOSED) -> Correction | Miss:
    """The point of the curve near ``u`` with row · (point − u) = 0.

    Args:
        curve: the equation.
        u: predicted point.
        D: derivative of the residual near there, shape (N, N + 1).
        row: what is held, shape (N + 1,).
        closed: closure that is enough.
    """
    u, D = u.copy(), D.copy()
    try:
        r, turn = curve.residual(u)
    except LostInterval as lost:
        return Miss(lost, None)
    closure = float(np.abs(r).max())
    for steps in range(_MOST + 1):
        du = np.linalg.lstsq(np.vstack([D, row]), np.append(-r, 0.0), rcond=1e-11)[0]
        if closure <= (closed if steps else _AT_ONCE):
            break
        if not np.abs(du).max() < _FAR:
            return Miss(None, turn)
        if steps == _MOST:
            break
        try:
            r_new, turn_new = curve.residual(u + du)
        except LostInterval as lost:
            return Correction(u, u, turn, closure, D, steps) if closure <= closed else Miss(lost, turn)
        closure_new = float(np.abs(r_new).max())
        if closure <= closed and closure_new >= 0.5 * closure:
            return Correction(u, u, turn, closure, D, steps)
        if steps > 1 and closure_new > 2 * closure:
            return Miss(None, turn_new)
        D += np.outer(r_new - r - D @ du, du) / (du @ du)
        u, r, turn, closure = u + du, r_new, turn_new, closure_new
    if closure > closed:
        return Miss(None, turn)
    return Correction(u, u + du if np.abs(du).max() < _LAST else u, turn, closure, D, steps)


NODES = 97  # at which an interval is kept
EARLY = 1.6  # by how much they crowd at its beginning, where the event has stirred up fast modes
_STEEP = 30.0  # derivative of the map from which on it has to be known better
_FALLEN = 1e-9  # s
ROUGH, FINE = 1e-5, 1e-6  # before the last extrapolation: along a branch, and where a special point is located


@dataclass(frozen=True, eq=False)
class Point:
    """A cycle on a branch.

    Attributes:
        u: where on the curve, shape (N + 1,).
        value: of the parameter.
        states: z at the events, shape (p, N).
        intervals: [s], shape (p,).
        y_peak, y_range: of the outputs over the period, shape (n_y,).
        J: DP^p, shape (N, N).
        multipliers: its eigenvalues by falling magnitude, shape (N,).
        closure: of the cycle.
        graze: the highest inner maximum of the event function over the threshold squared: −1 where it has none, 0 where
            an earlier event is about to cut in.
        slope: least Δ dE/dt at the events, over the threshold squared: 0 where an event is about to vanish.
        least: shortest time by which an interval exceeds Δ_min or the delay [s].
        samples: of each interval.
        D: derivative of the residual, shape (N, N + 1).
        derived: whether J was computed there, and not interpolated.
    """

    u: Array
    value: float
    states: Array
    intervals: Array
    y_peak: Array
    y_range: Array
    J: Array
    multipliers: NDArray[np.complex128]
    closure: float
    graze: float
    slope: float
    least: float
    samples: tuple[Sample, ...]
    D: Array
    derived: bool = True

    @property
    def fallen(self) -> bool:
        """Whether an interval ended at the minimum open-loop interval rather than by the event function."""
        return self.least <= _FALLEN

    @property
    def sigma(self) -> float:
        """The scaled parameter."""
        return float(self.u[-1])


def point(curve: Curve, found: Correction, tolerance: float | None = None, D: Array | None = None) -> Point:
    """The results at a point that the corrector found.

    Args:
        curve: the equation.
        found: the point.
        tolerance: of the flow's derivative; by default as fine as Newton's method needs for the next one.
        D: derivative of the residual where it is interpolated, shape (N, N + 1); computed by default.
    """
    if tolerance is None:
        tolerance = ROUGH if np.abs(found.D).max() < _STEEP else FINE
    derived = D is None
    loop = curve.loop(float(found.u[-1]))
    unit, turn = curve.unit(loop), found.turn
    courses = courses_of(loop, turn)
    if D is None:
        J = fast_jacobian(loop, turn, unit, courses, tolerance)
        D = found.D.copy()
        D[:, :-1] = curve.sign * J * (unit[None, :] / unit[:, None]) - np.eye(len(unit))
    else:
        J = map_of(curve, D)
    samples = tuple(along.sample(along.cuts[-1] * np.linspace(0, 1, NODES) ** EARLY) for along in courses)
    peak, spread = extent(turn, curve.sign)
    return Point(
        u=found.u,
        value=curve.range.value(float(found.u[-1])),
        states=turn.states,
        intervals=turn.intervals,
        y_peak=peak,
        y_range=spread,
        J=J,
        multipliers=eigenvalues(J),
        closure=found.closure,
        graze=max(_graze(loop, sample) for sample in samples),
        slope=min(
            _slope(loop, sample, along.rate, turn.intervals[i])
            for i, (sample, along) in enumerate(zip(samples, courses, strict=True))
        ),
        least=float(turn.intervals.min()) - loop.controller.least,
        samples=samples,
        D=D,
        derived=derived,
    )


def add_derivative(curve: Curve, at: Point) -> Point:
    """The point with its derivative computed from a new simulation."""
    _, turn = curve.residual(at.u)
    return point(curve, Correction(at.u, at.u, turn, at.closure, at.D, 0))


def redone(curve: Curve, at: Point, D: Array) -> Point:
    """The point with a newly interpolated derivative."""
    J = map_of(curve, D)
    return replace(at, D=D, J=J, multipliers=eigenvalues(J))


def map_of(curve: Curve, D: Array) -> Array:
    """DP^p by the derivative of the residual, shape (N, N)."""
    scale = curve.scale
    J: Array = curve.sign * (D[:, :-1] + np.eye(len(scale))) * (scale[:, None] / scale[None, :])
    return J


def eigenvalues(J: Array) -> NDArray[np.complex128]:
    """Eigenvalues by decreasing magnitude, shape (N,)."""
    values = np.linalg.eigvals(J).astype(complex)
    return values[falling(np.abs(values), values.real, values.imag)]


def _graze(loop: ReturnMap, sample: Sample) -> float:
    """The largest local maximum of max_j E_j while the event rule is active, away from the event."""
    faces = loop.controller.faces
    E = faces.levels(sample.x_h - sample.x_o).max(axis=1)
    watched = sample.t >= loop.controller.least
    E = E[watched]
    highest = -1.0
    for i, (before, after) in enumerate(pairwise(np.diff(E))):
        if before > 0 >= after:  # a parabola through three points
            bend = after - before
            highest = max(highest, float(E[i + 1] - (before + after) ** 2 / (8 * bend) if bend else E[i + 1]))
    return highest


def _slope(loop: ReturnMap, sample: Sample, rate: Array, interval: float) -> float:
    """Δ dE/dt on the active face at the end of an interval."""
    faces = loop.controller.faces
    e = sample.x_h[-1] - sample.x_o[-1]
    n, n_hat = loop.linear.n, len(e)
    e_rate = rate[n + n_hat : n + 2 * n_hat] - rate[n : n + n_hat]
    return float(interval * faces.rates(e, e_rate)[faces.active(e)])
