"""The derivative of the return map from the variational equation along an interval, at the cost of a few simulations.

Between events a neighbour departs by δẇ = F(t) δw, w = (x, a). Magnus's method of fourth order takes it through a
panel of length h:

    δw(t + h) = exp(h (F_0 + 4 F_½ + F_1)/6 − h² [F_0, F_1]/12) δw(t)

It is exact where F is constant, as on the linear plant, and on the engine errs by what the nonlinear plant's F varies
in a panel; panels are halved until that is small. At the event the projection along the flow takes a neighbour to *its*
event.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import layout_of, realise, start_state
from icmj.cycle.jacobian import jacobian
from icmj.cycle.return_map import ReturnMap, Turn
from icmj.errors import CycleError
from icmj.simulation.interval import Course

TOLERANCE = 1e-5  # relative, of one part's flow before the last extrapolation, which takes another digit or two off
_FIRST, _MOST = 4, 512  # panels


def courses_of(loop: ReturnMap, turn: Turn) -> list[Course]:
    """The trajectories of a turn's intervals."""
    rows = turn.rows or (None,) * len(turn.intervals)
    return [course(loop, *interval) for interval in zip(turn.states, turn.intervals, rows, strict=True)]


def course(loop: ReturnMap, z: Array, length: float, rows: Array | None = None) -> Course:
    """The trajectory of the interval from ``z``, whose ``length`` [s] is known, from the stored simulation."""
    x, x_o, x_h = loop.split(z)
    if loop.kind == "linear":
        from icmj.linear.open_loop import LinearCourse

        return LinearCourse(loop.linear, loop.controller, loop.settings, x, x_o, x_h, length)
    from icmj.engine.open_loop import EngineCourse, EngineOpenLoop

    assert isinstance(loop.fly, EngineOpenLoop)
    return EngineCourse(loop.fly, x, x_o, x_h, length, rows)


def fast_jacobian(
    loop: ReturnMap,
    turn: Turn,
    scale: Array,
    courses: Sequence[Course] | None = None,
    tolerance: float = TOLERANCE,
) -> Array:
    """DP^p along a turn, shape (N, N); by finite differences where the variational equation is not smooth enough.

    Args:
        loop: the return map.
        turn: the intervals.
        scale: size of each state, shape (N,).
        courses: of the intervals, if at hand.
        tolerance: of the variation's flow.

    Raises:
        CycleError: if there is no derivative.
    """
    if courses is None:
        courses = courses_of(loop, turn)
    J = np.eye(loop.size)
    try:
        for along in courses:
            J = derivative(loop, along, tolerance) @ J
    except CycleError:
        return jacobian(loop, turn.states[0], scale, len(turn.intervals)).J
    return J


def derivative(loop: ReturnMap, along: Course, tolerance: float = TOLERANCE) -> Array:
    """DP for one interval, shape (N, N).

    Raises:
        CycleError: if F varies so much, as where something touches or saturates, that the panels would be too many.
    """
    controls, n = realise(loop.controller), loop.linear.n
    flow = _lift(loop)
    for part, (low, high) in enumerate(zip(along.cuts, along.cuts[1:], strict=False)):
        if part:
            flow[n:] = controls.G @ flow[n:]
        flow = _flow(along, part, low, high, tolerance) @ flow
    if not loop.collapsed(along.cuts[-1]):
        end = along.sample(np.array([along.cuts[-1]]))
        faces, layout = loop.controller.faces, layout_of(loop.controller)
        gradient = np.zeros(len(flow))
        g = faces.gradient(end.x_h[0] - end.x_o[0])
        gradient[n:][layout["x_o"]], gradient[n:][layout["x_h"]] = -g, g
        flow = flow - np.outer(along.rate, gradient @ flow) / (gradient @ along.rate)
    parts = layout_of(loop.controller)
    x_o, x_h = flow[n:][parts["x_o"]], flow[n:][parts["x_h"]]
    return np.concatenate([flow[:n], x_o, *([x_h] if loop.holds else [])])


def _lift(loop: ReturnMap) -> Array:
    """w right after an event from z, shape (n + N_a, N)."""
    columns = []
    for unit in np.eye(loop.size):
        x, x_o, x_h = loop.split(unit)
        columns.append(np.concatenate([x, start_state(loop.controller, x_o, x_h)]))
    return np.array(columns).T


def _flow(along: Course, part: int, low: float, high: float, tolerance: float) -> Array:
    """δw(high) from δw(low)."""
    panels = _FIRST
    F = along.generators(np.linspace(low, high, 2 * panels + 1), part)
    if np.ptp(F, axis=0).max() == 0:
        from scipy.linalg import expm

        return np.asarray(expm(F[0] * (high - low)))
    rough = _magnus(F[::2], high - low)
    while True:
        fine = _magnus(F, high - low)
        if np.abs(fine - rough).max() / 15 <= tolerance * np.abs(fine).max():
            return fine + (fine - rough) / 15
        if panels >= _MOST:
            raise CycleError("the plant's derivative varies too fast along the flight")
        between = np.linspace(low, high, 4 * panels + 1)[1::2]
        finer = np.zeros((4 * panels + 1, *F.shape[1:]))
        finer[::2], finer[1::2] = F, along.generators(between, part)
        F, panels, rough = finer, 2 * panels, fine


def _magnus(F: Array, length: float) -> Array:
    """The flow through panels of which F holds ends and middles, shape (2 panels + 1, m, m) → (m, m)."""
    from scipy.linalg import expm

    panels = (len(F) - 1) // 2
    h = length / panels
    first, middle, last = F[:-1:2], F[1::2], F[2::2]
    omega = h / 6 * (first + 4 * middle + last) - h**2 / 12 * (first @ last - last @ first)
    flow = np.eye(F.shape[1])
    for step in expm(omega):
        flow = step @ flow
    return flow
