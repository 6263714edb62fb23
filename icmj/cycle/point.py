"""One cycle of a branch with its results: multipliers, trajectories of its intervals, distance from grazing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.cycle.curve import Correction, Curve
from icmj.cycle.jacobian import compute_jacobian, get_courses
from icmj.cycle.return_map import ReturnMap
from icmj.simulation.course import Sample
from icmj.theory.event_maps import compute_multipliers

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
        alternating: whether the cycle is a mirrored one of a family; see :class:`icmj.cycle.Cycle`.
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
    alternating: bool = False

    @property
    def fallen(self) -> bool:
        """Whether an interval ended at the minimum open-loop interval rather than by the event function."""
        return self.least <= _FALLEN

    @property
    def sigma(self) -> float:
        """The scaled parameter."""
        return float(self.u[-1])


def make_point(curve: Curve, found: Correction, tolerance: float | None = None, D: Array | None = None) -> Point:
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
    courses = get_courses(loop, turn)
    if D is None:
        J = compute_jacobian(loop, turn, unit, courses, tolerance)
        D = found.D.copy()
        D[:, :-1] = curve.sign * J * (unit[None, :] / unit[:, None]) - np.eye(len(unit))
    else:
        J = map_of(curve, D)
    samples = tuple(along.sample(along.cuts[-1] * np.linspace(0, 1, NODES) ** EARLY) for along in courses)
    peak, spread = turn.extent(curve.sign)
    return Point(
        u=found.u,
        value=curve.range.value(float(found.u[-1])),
        states=turn.states,
        intervals=turn.intervals,
        y_peak=peak,
        y_range=spread,
        J=J,
        multipliers=compute_multipliers(J),
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
        alternating=loop.is_alternating(curve.p, curve.sign),
    )


def add_derivative(curve: Curve, at: Point) -> Point:
    """The point with its derivative computed from a new simulation."""
    _, turn = curve.residual(at.u)
    return make_point(curve, Correction(at.u, at.u, turn, at.closure, at.D, 0))


def update_derivative(curve: Curve, at: Point, D: Array) -> Point:
    """The point with a newly interpolated derivative."""
    J = map_of(curve, D)
    return replace(at, D=D, J=J, multipliers=compute_multipliers(J))


def map_of(curve: Curve, D: Array) -> Array:
    """DP^p by the derivative of the residual, shape (N, N)."""
    scale = curve.scale
    J: Array = curve.sign * (D[:, :-1] + np.eye(len(scale))) * (scale[:, None] / scale[None, :])
    return J


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
