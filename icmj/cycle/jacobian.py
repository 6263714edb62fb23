"""The derivative of the return map by finite differences, and its multipliers with their errors."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, falling
from icmj.cycle.return_map import Flights, Lost
from icmj.errors import CycleError

# first step, relative to the scale of each state; shortened by tens where the map bends so much that it errs more by
# that than by rounding, as it does by fast modes, and near the end of a branch where intervals grow
STEP = 1e-4
ROUNDING = 2e-14  # relative: the least that is random in a flight's end
_SHORTER = 0.1
_LEAST = 1e-8


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


def jacobian(
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
        except Lost as lost:
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


def multipliers(J: Jacobian, scale: Array) -> tuple[NDArray[np.complex128], Array]:
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
    order = falling(np.abs(values), values.real, values.imag)
    return values[order].astype(complex), error[order]
