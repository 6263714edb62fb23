"""Newton's method on the return map: sign · P^p(z) = z."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.cycle.return_map import Flights, LostInterval, Turn
from icmj.errors import CycleError

CLOSED = 1e-10  # relative closure that counts
FLOOR = 2e-13  # relative closure below which a flight is only rounding
MOST = 25  # iterations
RANK = 1e-9  # singular values of sign·J − I below this, relative to the largest, are those of neutral modes
_HALVINGS = 12
LOG = logging.getLogger(__name__)
_MOST_EVENTS = 8  # per period, of what a simulation that has not settled may be near to
_QUIET = 1e-2  # of the middle one: the least scale of a state that does not move on the orbit


@dataclass(frozen=True, eq=False)
class ClosedCycle:
    """A cycle that Newton's method found.

    Attributes:
        z: state at an event, shape (N,).
        turn: its p intervals.
        closure: largest |sign·P^p(z) − z| relative to ``scale``.
        history: closures of all iterates, the first guess first.
        neutral: directions in which the cycle is not isolated; 0 but where a mode is neutral.
    """

    z: Array
    turn: Turn
    closure: float
    history: tuple[float, ...]
    neutral: int = 0


def solve_newton(
    loop: Flights,
    z: Array,
    scale: Array,
    derivative: Callable[[Turn], Array],
    *,
    p: int = 1,
    sign: int = 1,
    closed: float = CLOSED,
    progress: Callable[[float], None] | None = None,
) -> ClosedCycle:
    """Solve sign·P^p(z) = z, damped; the derivative is taken at the first guess and updated (Broyden), and taken anew
    where that converges slowly.

    Along neutral modes sign·J − I is singular, and the step is the shortest one.

    Args:
        loop: the return map.
        z: first guess, shape (N,).
        scale: size of each state on the cycle, shape (N,).
        derivative: DP^p along a turn, shape (N, N).
        p, sign: how many intervals, and whether they end in the mirror image.
        closed: closure that is enough.
        progress: called after each step with how many of the digits it lacked at first the closure has gained, 0–1.

    Raises:
        CycleError: if it finds none; the message says what the last iterates did.
    """
    D = scale[None, :] / scale[:, None]

    def residual(w: Array) -> tuple[Array, Turn]:
        turn = loop.turn(w, p)
        return (sign * turn.end - w) / scale, turn

    try:
        r, turn = residual(z)
    except LostInterval as lost:
        raise CycleError(f"no cycle: the first guess does not come back; {lost}") from lost
    G, fresh, neutral = None, False, None
    history = [float(np.abs(r).max())]
    for _ in range(MOST):
        if history[-1] <= FLOOR or (history[-1] <= closed and len(history) > 1 and history[-1] > 0.1 * history[-2]):
            break
        if G is None:
            G, fresh = sign * derivative(turn) * D - np.eye(len(z)), True
        step, neutral = solve_shortest(G, -r)
        found = _damp(residual, z, r, step, scale)
        if found is None:
            if history[-1] <= closed:
                break
            if not fresh:
                G = None
                continue
            raise CycleError(_explain_failure(loop, turn, history, _jump(residual, z, turn, step, scale)))
        length, z_new, r_new, turn_new = found
        # Broyden's update with what this step has shown
        s = length * step
        G = G + np.outer(r_new - r - G @ s, s) / (s @ s)
        if np.abs(r_new).max() > 0.2 * np.abs(r).max() and np.abs(r_new).max() > closed:
            G = None
        z, r, turn, fresh = z_new, r_new, turn_new, False
        history.append(float(np.abs(r).max()))
        LOG.debug("Newton step %d: closure %.1e", len(history) - 1, history[-1])
        if progress is not None:
            gained, lacking = np.log(history[0] / max(history[-1], closed)), np.log(max(history[0] / closed, 2.0))
            progress(float(np.clip(gained / lacking, 0, 1)))
    if not history[-1] <= closed:
        raise CycleError(_explain_failure(loop, turn, history))
    if neutral is None:  # the first guess was close enough
        _, neutral = solve_shortest(sign * derivative(turn) * D - np.eye(len(z)), -r)
    return ClosedCycle(z, turn, history[-1], tuple(history), neutral)


def solve_shortest(G: Array, r: Array) -> tuple[Array, int]:
    """The least-squares step, and the number of singular directions in which it is zero."""
    U, s, Vt = np.linalg.svd(G)
    kept = s > RANK * s[0]
    step = Vt[kept].T @ ((U.T @ r)[kept] / s[kept])
    return step, int((~kept).sum())


def _damp(
    residual: Callable[[Array], tuple[Array, Turn]], z: Array, r: Array, step: Array, scale: Array
) -> tuple[float, Array, Array, Turn] | None:
    """The longest damped step that reduces the residual; ``None`` if none does."""
    length, size = min(1.0, 2.0 / max(float(np.abs(step).max()), 1e-300)), float(np.linalg.norm(r))
    for _ in range(_HALVINGS):
        there = z + length * step * scale
        try:
            r_new, turn = residual(there)
        except LostInterval:
            length /= 2
            continue
        if np.linalg.norm(r_new) < (1 - 1e-4 * length) * size:
            return length, there, r_new, turn
        length /= 2
    return None


def _jump(
    residual: Callable[[Array], tuple[Array, Turn]], z: Array, turn: Turn, step: Array, scale: Array
) -> tuple[float, float] | None:
    """Two lengths of one interval on both sides of an edge of the map that lies close to z [s]; ``None`` without."""
    try:
        there = residual(z + 0.5**_HALVINGS * min(1.0, 2.0 / max(float(np.abs(step).max()), 1e-300)) * step * scale)[1]
    except LostInterval as lost:
        return float(turn.intervals[-1]), lost.flown
    gap = np.abs(there.intervals - turn.intervals)
    worst = int(gap.argmax())
    if gap[worst] < 0.02 * turn.intervals[worst]:
        return None
    return float(turn.intervals[worst]), float(there.intervals[worst])


def _explain_failure(loop: Flights, turn: Turn, history: list[float], jump: tuple[float, float] | None = None) -> str:
    where = f"Newton's iterates stop at a closure of {min(history):.1e} after {len(history) - 1} steps"
    if jump is not None:
        early, late = sorted(jump)
        return (
            f"no cycle: the event function grazes zero at {early:.6g} s, and an event there cuts the interval of "
            f"{late:.6g} s short; {where}"
        )
    if any(loop.has_collapsed(interval) for interval in turn.intervals):
        return f"no cycle: {where}, with an interval at the least one, {loop.least:g} s"
    last = ", ".join(f"{interval:.4g}" for interval in turn.intervals)
    return f"no cycle: {where}, intervals {last} s; start nearer to one, or from a simulation"
