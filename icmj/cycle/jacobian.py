"""The derivative of the return map, and its multipliers with their errors: by differences, or along an interval.

Along an interval it follows from the variational equation, at the cost of a few simulations. Between events a neighbour
departs by δẇ = F(t) δw, w = (x, a). Magnus's method of fourth order takes it through a panel of length h:

    δw(t + h) = exp(h (F_0 + 4 F_½ + F_1)/6 − h² [F_0, F_1]/12) δw(t)

It is exact where F is constant, as on the linear plant, and on the engine errs by what the nonlinear plant's F varies
in a panel; panels are halved until that is small. At the event the projection along the flow takes a neighbour to *its*
event.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, argsort_descending
from icmj.controller.controller import make_layout, start_state
from icmj.cycle.return_map import Flights, LostInterval, ReturnMap, Turn
from icmj.errors import CycleError
from icmj.simulation.course import Course

# first step, relative to the scale of each state; shortened by tens where the map bends so much that it errs more by
# that than by rounding, as it does by fast modes, and near the end of a branch where intervals grow
STEP = 1e-4
ROUNDING = 2e-14  # relative: the least that is random in a flight's end
_SHORTER = 0.1
_LEAST = 1e-8
TOLERANCE = 1e-5  # relative, of one part's flow before the last extrapolation, which takes another digit or two off


@dataclass(frozen=True, eq=False)
class Jacobian:
    """DP^p at a state.

    Attributes:
        J: shape (N, N).
        error: how wrong its entries may be: what flights round over the step, and ten times what the order after the
            next may be, judging by the gap between second and fourth; shape (N, N).
    """

    J: Array
    error: Array


def difference_jacobian(
    loop: Flights, z: Array, scale: Array, p: int = 1, *, threads: int = 1, rounding: float = ROUNDING
) -> Jacobian:
    """DP^p at ``z`` by centred differences of fourth order, each column with a step that is right for it.

    Args:
        loop: the return map.
        z: state at an event, shape (N,).
        scale: size of each state on the cycle, shape (N,).
        p: number of intervals.
        threads: that fly at once.
        rounding: relative to ``scale``, what is random in the end of a turn.

    Raises:
        CycleError: if neighbours do not come back: the map has an edge there.
    """
    N, step = len(z), STEP
    J, error, why = np.zeros((N, N)), np.full(N, np.inf), ""
    rounding = max(rounding, ROUNDING)
    loops = [loop, *(loop.another() for _ in range(min(threads, 4 * N) - 1))]
    while step >= _LEAST:
        # columns that err more by their step than by rounding
        poor = np.flatnonzero(error > 10 * rounding * np.maximum(np.abs(J / scale[:, None]).max(axis=0), 1.0) / step)
        if not len(poor):
            break
        try:
            near, far = _differences(loops, z, scale, p, poor, step)
        except LostInterval as lost:
            step, why = step * _SHORTER, str(lost)
            continue
        for j, a, b in zip(poor, near, far, strict=True):
            column, size = (4 * a - b) / 3, max(float(np.abs(a / scale).max()), 1.0)
            gap = float(np.abs((a - b) / scale).max()) / 3
            wrong = 10 * gap**2 / size + rounding * size / step
            if wrong < error[j]:
                J[:, j], error[j] = column, wrong
        step *= _SHORTER
    if not np.isfinite(error).all():
        raise CycleError(f"the return map has no derivative there: a neighbour of the cycle does not come back ({why})")
    # columns are with respect to z / scale so far
    return Jacobian(J / scale[None, :], error[None, :] * scale[:, None] / scale[None, :])


def _differences(
    loops: list[Flights], z: Array, scale: Array, p: int, columns: NDArray[np.intp], step: float
) -> tuple[Array, Array]:
    """d P^p / d(z/scale) over ± step and over ± 2 step, shapes (len(columns), N)."""
    offsets = np.array([-2.0, -1.0, 1.0, 2.0])
    tasks = [(i, k) for i in range(len(columns)) for k in range(4)]
    ends, exact = np.zeros((len(columns), 4, len(z))), np.zeros((len(columns), 4))

    def fly(own: Flights, part: list[tuple[int, int]]) -> None:
        for i, k in part:
            j, there = columns[i], z.copy()
            there[j] += offsets[k] * step * scale[j]
            exact[i, k] = (there[j] - z[j]) / scale[j]  # what is added is not quite what was asked for
            ends[i, k] = own.turn(there, p).end

    parts = [tasks[i :: len(loops)] for i in range(len(loops))]
    if len(loops) == 1:
        fly(loops[0], tasks)
    else:
        with ThreadPoolExecutor(len(loops)) as pool:
            list(pool.map(fly, loops, parts))
    near = (ends[:, 2] - ends[:, 1]) / (exact[:, 2] - exact[:, 1])[:, None]
    far = (ends[:, 3] - ends[:, 0]) / (exact[:, 3] - exact[:, 0])[:, None]
    return near, far


def compute_multipliers(J: Jacobian, scale: Array) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues of J by decreasing magnitude, and their errors due to that of J; shapes (N,), (N,).

    The error is first-order perturbation theory's |yᴴ δJ x| / |yᴴ x| in the coordinates that ``scale`` makes alike,
    and the size of the nearest cluster's spread where x and y are so nearly orthogonal that this says nothing.
    """
    from scipy.linalg import eig

    D = scale[None, :] / scale[:, None]
    values, left, right = eig(J.J * D, left=True, right=True)
    delta = J.error * D
    overlap = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    bound = np.einsum("ij,ik,kj->j", np.abs(left), delta, np.abs(right))
    with np.errstate(divide="ignore"):
        # of a Jordan block of two, the square root of the perturbation
        error = np.minimum(bound / np.maximum(overlap, 1e-300), np.sqrt(np.linalg.norm(delta)))
    order = argsort_descending(np.abs(values), values.real, values.imag)
    return values[order].astype(complex), error[order]


_FIRST, _MOST = 4, 512  # panels


def get_courses(loop: ReturnMap, turn: Turn) -> list[Course]:
    """The trajectories of a turn's intervals."""
    rows = turn.rows or (None,) * len(turn.intervals)
    return [get_course(loop, *interval) for interval in zip(turn.states, turn.intervals, rows, strict=True)]


def get_course(loop: ReturnMap, z: Array, length: float, rows: Array | None = None) -> Course:
    """The trajectory of the interval from ``z``, whose ``length`` [s] is known, from the stored simulation."""
    x, x_o, x_h = loop.split(z)
    if loop.kind == "linear":
        from icmj.linear.course import LinearCourse

        return LinearCourse(loop.linear, loop.controller, loop.settings, x, x_o, x_h, length)
    from icmj.engine.open_loop import EngineCourse, EngineOpenLoop

    assert isinstance(loop.fly, EngineOpenLoop)
    return EngineCourse(loop.fly, x, x_o, x_h, length, rows)


def compute_jacobian(
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
        courses = get_courses(loop, turn)
    J = np.eye(loop.size)
    try:
        for along in courses:
            J = integrate_derivative(loop, along, tolerance) @ J
    except CycleError:
        return difference_jacobian(loop, turn.states[0], scale, len(turn.intervals)).J
    return J


def integrate_derivative(loop: ReturnMap, along: Course, tolerance: float = TOLERANCE) -> Array:
    """DP for one interval, shape (N, N).

    Raises:
        CycleError: if F varies so much, as where something touches or saturates, that the panels would be too many.
    """
    controls, n = loop.controller.realisation, loop.linear.n
    flow = _lift(loop)
    for part, (low, high) in enumerate(zip(along.cuts, along.cuts[1:], strict=False)):
        if part:
            flow[n:] = controls.G @ flow[n:]
        flow = _flow(along, part, low, high, tolerance) @ flow
    if not loop.has_collapsed(along.cuts[-1]):
        end = along.sample(np.array([along.cuts[-1]]))
        faces, layout = loop.controller.faces, make_layout(loop.controller)
        gradient = np.zeros(len(flow))
        g = faces.gradient(end.x_h[0] - end.x_o[0])
        gradient[n:][layout["x_o"]], gradient[n:][layout["x_h"]] = -g, g
        flow = flow - np.outer(along.rate, gradient @ flow) / (gradient @ along.rate)
    parts = make_layout(loop.controller)
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
