"""Corrector of the continuation: a quasi-Newton method on the cycle equation and a condition along the curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.cycle.curve import Curve
from icmj.cycle.return_map import Lost, Turn

CLOSED = 1e-10  # relative closure
_AT_ONCE = 1e-10  # closure of a prediction that needs no step
_LAST = 1e-5  # a step that is no longer than this is believed without a flight
_MOST = 9  # steps
_FAR = 0.5  # a step longer than this, in units of the state's size, has lost the curve


@dataclass(frozen=True, eq=False)
class Corrected:
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
class Missed:
    """No point was found, and the last reason why.

    Attributes:
        lost: the flight that did not come back, or ``None``.
        turn: the last one, or ``None``.
    """

    lost: Lost | None
    turn: Turn | None


def correct(curve: Curve, u: Array, D: Array, row: Array, closed: float = CLOSED) -> Corrected | Missed:
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
    except Lost as lost:
        return Missed(lost, None)
    closure = float(np.abs(r).max())
    for steps in range(_MOST + 1):
        du = np.linalg.lstsq(np.vstack([D, row]), np.append(-r, 0.0), rcond=1e-11)[0]
        if closure <= (closed if steps else _AT_ONCE):
            break
        if not np.abs(du).max() < _FAR:
            return Missed(None, turn)
        if steps == _MOST:
            break
        try:
            r_new, turn_new = curve.residual(u + du)
        except Lost as lost:
            return Corrected(u, u, turn, closure, D, steps) if closure <= closed else Missed(lost, turn)
        closure_new = float(np.abs(r_new).max())
        if closure <= closed and closure_new >= 0.5 * closure:
            return Corrected(u, u, turn, closure, D, steps)
        if steps > 1 and closure_new > 2 * closure:
            return Missed(None, turn_new)
        D += np.outer(r_new - r - D @ du, du) / (du @ du)
        u, r, turn, closure = u + du, r_new, turn_new, closure_new
    if closure > closed:
        return Missed(None, turn)
    return Corrected(u, u + du if np.abs(du).max() < _LAST else u, turn, closure, D, steps)
