"""Continuation: cycles along a parameter by pseudo-arclength, past folds, to where they change or end.

A step is predicted by the polynomial through the last points of the curve in its length, and corrected on the plane
across the curve, or at a fixed parameter where the curve runs with it, because a loop at a new parameter has to be
built. Steps grow where the prediction is good. On the way test functions of the multipliers tell where stability
changes (:mod:`icmj.cycle.crossing`); how a branch ends is :mod:`icmj.cycle.ending`'s.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from icmj.base.array import Array
from icmj.cycle.branch import SpecialPoint
from icmj.cycle.corrector import CLOSED, Missed, correct
from icmj.cycle.crossing import Test, critical, crossed, described, kappas, locate, value_of
from icmj.cycle.curve import Curve
from icmj.cycle.ending import CLOSE, Ending, homoclinic, missed, passed, touching, worn_out
from icmj.cycle.point import FINE, Point, point

_DEGREE = 4  # of the predicting polynomial
_BENDING = 3  # points through which the derivative is extrapolated
_GOOD = 0.02  # error of a prediction, in units of the state's size, that leaves the step as it is
_JUMP = 0.3  # relative change of an interval that no step of a smooth branch makes
_ACROSS = 0.35  # below this part of the parameter in the tangent, a step is measured along the curve
_AHEAD = 0.8  # least cosine of the angle between two steps
_ROUNDING = 1e-14  # relative, of a flight's end, before the map magnifies it
_AGAIN = 1.15  # growth of an interval after which it is asked anew whether it is without bound
_LEAST = 1e-9  # step
_MOST = 600  # points


@dataclass(frozen=True, eq=False)
class Walk:
    """A branch as it was walked.

    Attributes:
        points: on it.
        specials: found.
        end: why it ends.
        flights: how many intervals were flown.
    """

    points: tuple[Point, ...]
    specials: tuple[SpecialPoint, ...]
    end: str
    flights: int


def walk(
    curve: Curve,
    first: Point,
    *,
    points: int = 40,
    tangent: Array | None = None,
    neutral: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Walk:
    """Walk the curve from a point until the parameter leaves its range, or the branch ends.

    Args:
        curve: the equation of the cycles.
        first: a point on it.
        points: how many at least, if the branch runs through the whole range.
        tangent: where to, shape (N + 1,); with rising σ if ``None``.
        neutral: multipliers that are 1 by construction.
        progress: called now and then with the part of the range done, 0–1.
    """
    walker = _Walker(curve, first, points, neutral)
    walker.begin(tangent)
    while walker.ending is None and len(walker.points) < _MOST:
        walker.step()
        if progress is not None:
            progress(float(np.clip(walker.points[-1].sigma, 0, 1)))
    end = walker.ending or Ending(None, f"stopped after {_MOST} points")
    # of those that close in on an end, the last is enough
    kept = [i for i in range(len(walker.points)) if i not in walker.near or i == len(walker.points) - 1]
    found = [*walker.specials, *([end.special] if end.special else [])]
    specials = [replace(s, index=max(bisect_right(kept, s.index) - 1, 0)) for s in found]
    return Walk(tuple(walker.points[i] for i in kept), tuple(specials), end.words, curve.flights)


class _Walker:
    def __init__(self, curve: Curve, first: Point, points: int, neutral: int) -> None:
        self.curve, self.points, self.neutral = curve, [first], neutral
        self.specials: list[SpecialPoint] = []
        self.ending: Ending | None = None
        self.longest = 1.0 / points
        self.s = [0.0]  # length along the curve
        self.ds = self.longest
        self.closing, self.asked = False, 0.0
        self.near: set[int] = set()  # points taken while closing in on an end
        self.tangent = np.zeros_like(first.u)

    def begin(self, tangent: Array | None) -> None:
        """The first tangent, from the derivative with respect to the parameter unless it is given."""
        first, curve = self.points[0], self.curve
        h = 1e-4 if first.sigma < 0.5 else -1e-4
        ahead = first.u.copy()
        ahead[-1] += h
        D = first.D.copy()
        D[:, -1] = (curve.residual(ahead)[0] - curve.residual(first.u)[0]) / h
        self.points[0] = replace(first, D=D)
        if tangent is None:
            tangent = np.append(np.linalg.lstsq(D[:, :-1], -D[:, -1], rcond=1e-9)[0], 1.0)
        self.tangent = tangent / curve.length(tangent)

    def predict(self, ds: float) -> Array:
        """The point at a length ``ds`` from the last."""
        recent = min(len(self.points), _DEGREE + 1)
        if recent == 1:
            return self.points[-1].u + ds * self.tangent
        s = np.array(self.s[-recent:]) - self.s[-1]
        return _interpolate(s, np.array([p.u for p in self.points[-recent:]]), ds)

    def derivative(self, ds: float) -> Array:
        """The residual's derivative at a length ``ds`` from the last, from those at the last points."""
        recent = min(len(self.points), _BENDING)
        s = np.array(self.s[-recent:]) - self.s[-1]
        D = np.array([p.D.reshape(-1) for p in self.points[-recent:]])
        return _interpolate(s, D, ds).reshape(self.points[-1].D.shape)

    def step(self) -> None:
        """One step, taken or halved."""
        curve, last = self.curve, self.points[-1]
        curve.patient(float(last.intervals.max()))
        u = self.predict(self.ds)
        lands = bool((u[-1] - 1) * (last.sigma - 1) < 0 or (u[-1] * last.sigma < 0))
        D = self.derivative(self.ds)
        direction = (u - last.u) / max(curve.length(u - last.u), 1e-300)
        row = curve.normal(direction)
        if lands:
            edge = 1.0 if (u[-1] - 1) * (last.sigma - 1) < 0 else 0.0
            part = (edge - last.sigma) / (u[-1] - last.sigma)
            u, D = last.u + (u - last.u) * part, self.derivative(part * self.ds)
            u[-1] = edge
        if lands or abs(direction[-1]) > _ACROSS:
            row = np.append(np.zeros(len(u) - 1), 1.0)
        found = correct(curve, u, D, row, self.closed(last))
        if isinstance(found, Missed) or self.jumped(found.turn.intervals, u):
            self.closing = (
                self.closing or not isinstance(found, Missed) or found.lost is not None or touching(self.points)
            )
            self.shorter(found if isinstance(found, Missed) else Missed(None, found.turn))
            return
        if not lands and (found.u[-1] - 1) * (last.sigma - 1) < 0 and self.ds > 1e-4 * self.longest:
            self.ds *= 0.7 * (1 - last.sigma) / (found.u[-1] - last.sigma)  # past the end of the range
            return
        error = float(np.abs(found.u - u)[:-1].max()) / curve.weight
        back = curve.turn_of(self.tangent, found.u - last.u) < _AHEAD  # where it came from, or round a corner
        if (back and self.ds > 1e-4 * self.longest) or (error > 10 * _GOOD and self.ds > 1e-3 * self.longest):
            self.ds *= 0.4
            return
        new = point(curve, found)
        self.accept(new)
        if lands and self.ending is None:
            self.ending = Ending(None, f"reached {curve.family.parameter.name} = {new.value:.6g}")
        if not self.closing:
            order = min(len(self.points), _DEGREE + 1)
            self.ds *= float(np.clip((_GOOD / max(error, 1e-9)) ** (1 / order), 0.4, 1.7))
            self.ds = min(self.ds, 4 * self.longest, self.longest / max(abs(self.tangent[-1]), 0.25))

    @staticmethod
    def closed(near: Point) -> float:
        """Closure that is enough: a map that magnifies what it rounds cannot be asked for more."""
        return max(CLOSED, _ROUNDING * float(np.abs(near.D).max()))

    def jumped(self, intervals: Array, u: Array) -> bool:
        """Whether another cycle was found, or events have changed places."""
        return bool((np.abs(intervals / self.points[-1].intervals - 1) > _JUMP).any())

    def shorter(self, why: Missed) -> None:
        """Halve the step; where it has become nothing, the branch ends."""
        self.ds /= 2
        close = abs(self.curve.range.slope(self.points[-1].sigma)) * self.ds * max(abs(self.tangent[-1]), 1e-3)
        if self.ds < _LEAST or (self.closing and close < CLOSE):
            self.ending = missed(self.curve, self.points, why)

    def accept(self, new: Point) -> None:
        """Take a point onto the branch; look what has happened since the last."""
        last, curve = self.points[-1], self.curve
        du = new.u - last.u
        length = curve.length(du)
        curve.weigh(new.u)
        self.tangent = du / curve.length(du)
        new = replace(new, D=self.along(new))
        self.points.append(new)
        self.s.append(self.s[-1] + length)
        if self.closing:
            self.near.add(len(self.points) - 1)
        before, after = (kappas(p.multipliers, curve.sign, self.neutral) for p in (last, new))
        for test in crossed(before, after):
            special = self.crossing(test)
            if special is not None:
                self.specials.append(special)
        self.specials[-5:] = sorted(self.specials[-5:], key=lambda s: s.index)
        self.ending = (
            passed(curve, self.points, self.between)
            or self.without_bound()
            or worn_out(curve, self.points, self.closed(new))
        )

    def along(self, new: Point) -> Array:
        """The derivative of the residual with its last column from the direction of the curve, where that shows it."""
        D = new.D.copy()
        recent = min(len(self.points) + 1, _DEGREE + 1)
        s = np.append(np.array(self.s[1 - recent :]), self.s[-1] + self.curve.length(new.u - self.points[-1].u))
        us = np.array([*(p.u for p in self.points[1 - recent :]), new.u])
        h = 1e-3 * (s[-1] - s[-2])
        slope = (us[-1] - _interpolate(s, us, s[-1] - h)) / h
        if abs(slope[-1]) > 0.02:
            D[:, -1] = -D[:, :-1] @ slope[:-1] / slope[-1]
        return D

    def between(self, part: float) -> Point | None:
        """The point at a part of the way from the last but one to the last."""
        recent = min(len(self.points), _DEGREE + 2)
        s = np.array(self.s[-recent:])
        at = s[-2] + part * (s[-1] - s[-2])
        us = np.array([p.u for p in self.points[-recent:]])
        u = _interpolate(s, us, at)
        row = self.curve.normal((us[-1] - us[-2]) / (s[-1] - s[-2]))
        nearest = self.points[-1] if part > 0.5 else self.points[-2]
        found = correct(self.curve, u, nearest.D, row, self.closed(nearest))
        return None if isinstance(found, Missed) else point(self.curve, found, FINE)

    def without_bound(self) -> Ending | None:
        """Whether the interval is on its way to infinity; asked again only once it has grown further."""
        longest = float(self.points[-1].intervals.max())
        if longest < _AGAIN * self.asked:
            return None
        self.asked = longest
        found = homoclinic(self.curve, self.points, self.settle)
        del self.s[len(self.points) :]
        return found

    def settle(self, value: float, closed: float) -> Point | None:
        """The point at a value of the parameter, with the last as first guess."""
        last, sigma = self.points[-1], self.curve.range.sigma(value)
        u = last.u.copy()
        if len(self.points) > 1 and self.points[-1].sigma != self.points[-2].sigma:
            gap = (sigma - last.sigma) / (last.sigma - self.points[-2].sigma)
            u += 0.5 * gap * (last.u - self.points[-2].u)
        u[-1] = sigma
        found = correct(self.curve, u, last.D, np.append(np.zeros(len(u) - 1), 1.0), closed)
        if isinstance(found, Missed):
            return None
        new = point(self.curve, found)
        self.s.append(self.s[-1] + self.curve.length(new.u - last.u))
        self.points.append(new)
        return new

    def crossing(self, test: Test) -> SpecialPoint | None:
        """The special point between the last two points."""
        curve, neutral = self.curve, self.neutral
        left, right = self.points[-2:]

        def f(at: Point) -> float:
            return value_of(test, kappas(at.multipliers, curve.sign, neutral))

        at = locate(left, right, f, self.between, CLOSE)
        if at is None:
            at = left if abs(f(left)) < abs(f(right)) else right
        kappa = critical(test, kappas(at.multipliers, curve.sign, neutral))
        if kappa is None:
            return None
        return described(curve, test, kappa, at, len(self.points) - 2, self.turns(left, right))

    def turns(self, left: Point, right: Point) -> bool:
        """Whether the parameter turns about between the last two points."""
        if len(self.points) < 3:
            return False
        before = left.sigma - self.points[-3].sigma
        step = np.array(self.s[-3:])
        us = np.array([p.u[-1] for p in self.points[-3:]])[:, None]
        h = 1e-3 * (step[-1] - step[-2])
        after = right.sigma - float(_interpolate(step, us, step[-1] - h)[0])
        return before * (right.sigma - left.sigma) < 0 or before * after < 0


def _interpolate(s: Array, values: Array, at: float) -> Array:
    """The polynomial through (s_i, values_i) at a place; shapes (k,), (k, m) → (m,)."""
    weights = np.ones(len(s))
    for i in range(len(s)):
        for j in range(len(s)):
            if i != j:
                weights[i] *= (at - s[j]) / (s[i] - s[j])
    return np.asarray(weights @ values)
