"""The curve of cycles over a parameter: the equation that they satisfy, and a point of it from a guess near by.

A point is u = (w, σ), both parts of order one. w is z relative to the size of each state and of the threshold, so that
on the linear plant it does not change with q_t; σ runs from 0 to 1 between the ends of the range, by the logarithm of
the parameter where that range spans a decade. Lengths are measured by |w|²/N + σ², w by its size where that has grown.
A point is found by a quasi-Newton method on the equation and a condition along the curve.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.cycle.family import ReturnMaps
from icmj.cycle.return_map import LostInterval, ReturnMap, Turn
from icmj.errors import CycleError

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
