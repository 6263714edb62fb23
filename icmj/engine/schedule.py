"""When the closed loop steps, acts, records and stops: everything a loop needs besides the model; and its record.

The record is preallocated buffers, filled from the beginning in every chunk of steps.

The embedded Runge–Kutta methods that steps are adapted with, and their dense output.

Dormand and Prince's DOP853 of order 8 with the error estimate and the dense output of order 7 of Hairer, Nørsett and
Wanner (Solving Ordinary Differential Equations I, II.5 and II.6), with the coefficients that SciPy carries; and
Sofroniou and Spaletta's method of order 4 with Hermite's cubic (Mathematical and Computer Modelling 40, 2004).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.base.roots import ONE_INSTANT
from icmj.controller.controller import Law
from icmj.plant.linear_plant import LinearPlant

STAGES, RATES, POWER = 12, 16, 7
GROWTH, SHRINKAGE, SAFETY = 6.0, 0.2, 0.9
SHORTEST = 1e-11  # s; a step that has to be shorter meets something that is not smooth
NUDGE = 1e-4  # an event is polished by steps of so many times the loop's shortest time constant, or less
METHODS = {4: ("RK34", 2, 1.5), 8: ("DOP853", 8, 5.0)}
"""By order: a name, the number of samples of the outputs in a step, and the local error allowed at a step's end over
the tolerance."""
WITHIN = 10.0  # error allowed of any state within a step over the tolerance
LAST = 1 / 700  # of the last vector of order 8's dense output: what that output errs by; see method_for
STIFF = 20.0  # times the plant's slowest rate: where the loop's fastest is beyond that, stability bounds steps
LOOSE = 3e-6  # from this tolerance on a stiff loop is quicker with order 4
_LOOKS = 4  # in a stiff loop steps are short, measured by the motion


class Tableau(NamedTuple):
    """Coefficients of a method as arrays, which compiled code takes; all methods have those of the longest.

    Attributes:
        A, c: of the stages and of those more for dense output, shapes (16, 16), (16,). Row ``stages`` is the weights b.
        E3, E5: of the two error estimates, shape (13,); E3 is 0 where there is only one.
        D: of the dense output's last four vectors, shape (4, 16).
        powers: of the dense output's seven basis functions, shape (7, 8).
        stages: s, after which the step's end is known; the rates there are number s.
        rates: that dense output takes.
        order: of the step's end.
        looks: at the outputs in every step, from which their extremes are found.
        exponent: of the error by which steps grow.
        allowed: local error at a step's end, relative to the motion, over the tolerance.
    """

    A: Array
    c: Array
    E3: Array
    E5: Array
    D: Array
    powers: Array
    stages: int
    rates: int
    order: int
    looks: int
    exponent: float
    allowed: float


def method_for(tolerance: float, stiff: bool) -> Tableau:
    """The method for a tolerance.

    Order 8 is the best nearly everywhere. In a stiff loop its steps are bounded by stability long before they are by
    accuracy; of order 4 both bounds meet at a loose tolerance.

    What is recorded lies on the dense output. That of order 4 errs about as much as the step's end does, that of order
    8 a hundred times as much where stability bounds the steps: of y' = λy, where λ does not grow and the step is 1/|λ|
    to 6/|λ|, it errs by 1/700 to 1/870 of the last of its vectors. So its error is estimated, too, by :data:`LAST`.
    """
    if not stiff:
        return tableau(8)
    method = tableau(4 if tolerance >= LOOSE else 8)
    return method._replace(looks=min(method.looks, _LOOKS))


class _RK34:
    """Coefficients as SciPy's methods have them."""

    A = np.array([[0, 0, 0], [2 / 5, 0, 0], [-3 / 20, 3 / 4, 0], [19 / 44, -15 / 44, 10 / 11]])
    B, C = np.array([11, 25, 25, 11]) / 72, np.array([0, 2 / 5, 3 / 5, 1])
    E = np.append(B, 0) - np.array([1251515, 3710105, 2519695, 61105, 1428492]) / 8970912


@cache
def tableau(order: int) -> Tableau:
    """The method of order 4 or 8."""
    from scipy.integrate import DOP853

    _, looks, allowed = METHODS[order]
    method: Any = _RK34 if order == 4 else DOP853
    s, given = len(method.B), method.A.shape[1]
    A, c, D = np.zeros((RATES, RATES)), np.zeros(RATES), np.zeros((4, RATES))
    E3, E5 = np.zeros(STAGES + 1), np.zeros(STAGES + 1)
    A[:s, :given], c[:s] = method.A[:s], method.C
    A[s, :s], c[s] = method.B, 1.0
    if order == 8:
        A[s + 1 :], c[s + 1 :] = method.A_EXTRA, method.C_EXTRA
        E3[:], E5[:], D[:] = method.E3, method.E5, method.D
    else:
        E5[: s + 1] = method.E
    powers, basis = np.zeros((POWER, POWER + 1)), Polynomial([1.0])
    for k in range(POWER):
        basis = basis * (Polynomial([0.0, 1.0]) if k % 2 == 0 else Polynomial([1.0, -1.0]))
        powers[k, : k + 2] = basis.coef
    return Tableau(A, c, E3, E5, D, powers, s, RATES if order == 8 else s + 1, order, looks, -1 / order, allowed)


def round_step(step: float) -> float:
    """The step, down to five binary digits: error estimates carry rounding errors, which must not show in the step."""
    mantissa, exponent = math.frexp(step)
    return math.ldexp(math.floor(mantissa * 32) / 32, exponent)


def is_stiff(plant: LinearPlant, fastest: float) -> bool:
    """Whether a loop with this ``fastest`` rate [1/s] is much faster than the plant's own slow motion."""
    rates = np.abs(np.linalg.eigvals(plant.A))
    moving = rates[rates > 1e-3 * fastest]
    return bool(fastest > STIFF * moving.min(initial=fastest))


def fastest_rate(plant: LinearPlant, controller: Law) -> float:
    """Largest |λ| of plant and controller between events, in any mode, as if nothing were delayed [rad/s]."""
    controls = controller.realisation
    fastest = 0.0
    for mode in controls.modes:
        read = controls.read(plant.C, mode)
        closed = np.block([[plant.A, -plant.B @ mode.K], [np.zeros((len(mode.M), plant.n)), mode.M]])
        closed += np.vstack([-plant.B @ mode.S[:, : len(read)], mode.N[:, : len(read)]]) @ read
        fastest = max(fastest, float(np.abs(np.linalg.eigvals(closed)).max()))
    return fastest


EVENT_TOLERANCE = 1e-13  # s; event times are located by Newton until a correction is smaller than this

NO_END = 2**62


@dataclass(frozen=True, eq=False)
class Schedule:
    """Times of one run.

    Attributes:
        timestep: h [s]; of adaptive steps a length to begin with.
        t_end: where the run ends [s].
        delta_min: Δ_min of the event trigger, counted from the event [s].
        clock: interval of the clock trigger [s]; infinite for others.
        delay: t_d from an event to its action [s].
        edges: times at which the disturbance may jump [s], rising; steps end on them.
        phases: a time within each stretch between edges, shape (len(edges) + 1,).
        record_interval: rows are at its multiples, of fixed steps at the first that ends there or later, and at events,
            actions, ``breaks`` and the end [s].
        limits: the run has fallen when a position departs further than its own [rad or m], shape (nv,).
        rate: fastest rate |λ| of the linear closed loop [rad/s]; bounds how far E(t) can leave its Hermite cubic.
        events: number of events after which to stop.
        tolerance: relative error of an open-loop interval that adaptive steps keep to; 0 where the timestep is given.
        stiff: whether the loop's fast modes, rather than accuracy, would bound long steps.
        sampling: d_s from when the event rule reaches its threshold to the event [s].
        breaks: edges at which the motion jumps or bends, and instants at which the controller reads that [s], rising.
    """

    timestep: float
    t_end: float
    delta_min: float
    clock: float
    delay: float
    edges: Array
    phases: Array
    record_interval: float
    limits: Array
    rate: float
    events: int = NO_END
    tolerance: float = 0.0
    stiff: bool = False
    sampling: float = 0.0
    breaks: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def method(self) -> Tableau:
        """The Runge–Kutta method of adaptive steps."""
        return method_for(self.tolerance, self.stiff)

    @property
    def first_step(self) -> float:
        """Length of the first adaptive step [s]; 0 for a fixed timestep."""
        if not self.tolerance:
            return 0.0
        return float(self.tolerance ** (1 / self.method.order) / self.rate)

    def clock_action(self, number: int) -> float:
        """Time of the action of this event of the clock [s]; a tick if the delay is a multiple of its interval."""
        ticks = self.delay / self.clock
        if abs(ticks - round(ticks)) < RELATIVE_ROUNDING * ticks:
            return (number + round(ticks)) * self.clock
        return number * self.clock + self.delay

    def jumps(self, start: float, end: float) -> Array:
        """Times strictly between two successive events at which inputs jump: edges and actions, rising."""
        first = int(np.searchsorted(self.edges, start, side="right"))
        inside = self.edges[first : max(first, int(np.searchsorted(self.edges, end)))]
        if self.delay == 0:
            return inside
        if np.isfinite(self.clock):
            first, last = int((start - self.delay) / self.clock) - 1, int(end / self.clock) + 1
            acts = np.array([self.clock_action(number) for number in range(max(first, 0), last)])
        else:
            acts = np.array([start + self.delay])
        return np.union1d(inside, acts[(acts > start) & (acts < end)])

    def first_edge(self, t: float) -> int:
        """Index of the first edge after ``t``, which is also that of the stretch around ``t``."""
        return int(np.searchsorted(self.edges, t, side="right"))

    def first_clock(self, t: float) -> int:
        """Number of the first event of the clock after ``t``."""
        return int(np.floor(t / self.clock * (1 + 1e-12))) + 1


def row_after(t: float, interval: float, breaks: Array) -> float:
    """When the first row after ``t`` is due [s]: at a multiple of ``interval`` or a break, of which the last is inf.

    Where ``t`` is one itself, but for rounding, it is the next.
    """
    return float(
        min(
            (np.floor(t / interval + 1e-8) + 1) * interval,
            breaks[np.searchsorted(breaks, t + ONE_INSTANT, side="right")],
        )
    )


def phases_of(edges: Array) -> Array:
    """A time ≥ 0 strictly within each stretch between ``edges``."""
    if len(edges) == 0:
        return np.zeros(1)
    return np.concatenate([[edges[0] / 2], (edges[1:] + edges[:-1]) / 2, [edges[-1] + 1]])


class Recording(NamedTuple):
    """Buffers for one chunk of at most N steps; a named tuple, which compiled code takes.

    Attributes:
        dense: time and outputs at the end of every step, shape (N, 1 + n_y).
        rows: decimated rows (t, qpos, qvel, act, sensordata), shape (N, width).
        events: the same rows at the events, before the reset, shape (N, width).
        event_at: index of each event's row in ``dense``, shape (N,).
        count: rows filled in dense, rows, events; and steps taken; shape (4,).
    """

    dense: Array
    rows: Array
    events: Array
    event_at: np.ndarray
    count: np.ndarray  # type: ignore[assignment]

    def clear(self) -> None:
        """Start a new chunk."""
        self.count[:] = 0


def recording(steps: int, n_y: int, width: int) -> Recording:
    """Buffers for ``steps`` steps or samples."""
    return Recording(
        np.empty((steps, 1 + n_y)),
        np.empty((steps, width)),
        np.empty((steps, width)),
        np.zeros(steps, dtype=np.int64),
        np.zeros(4, dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class States:
    """Rows as departures from the operating point, shapes (N, ...)."""

    x: Array
    x_o: Array
    x_h: Array
    y: Array
