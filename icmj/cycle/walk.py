"""Continuation by pseudo-arclength: a walk along the curve of cycles, past folds, to where they change or end.

A step is predicted by the polynomial through the last points of the curve in its length (:mod:`icmj.cycle.trail`),
and corrected on the plane across the curve, or at a fixed parameter where the curve runs with it, because a loop at a
new parameter has to be built. Steps grow where the prediction is good. The map's derivative is computed at as many
points as it takes to interpolate it at the others. On the way test functions of the multipliers tell where stability
changes (:mod:`icmj.cycle.stability_changes`); how a branch ends is :mod:`icmj.cycle.endings`'s.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.cycle.bracketing import locate
from icmj.cycle.branch import SpecialPoint
from icmj.cycle.curve import CLOSED, Curve, Miss, correct
from icmj.cycle.endings import (
    CLOSE,
    Ending,
    end_at_least_interval,
    end_by_rounding,
    end_where_lost,
    find_homoclinic_end,
    is_touching,
    round_trip,
)
from icmj.cycle.point import FINE, Point, add_derivative, make_point, update_derivative
from icmj.cycle.return_map import LostInterval
from icmj.cycle.stability_changes import (
    Test,
    compute_kappas,
    describe_crossing,
    evaluate_test,
    find_critical,
    find_crossed,
)
from icmj.cycle.trail import Trail, interpolate

_SPARSE = 4  # points from one derivative to the next, at most
_TRUE, _FALSE = 1e-4, 1e-3  # relative errors of an extrapolated derivative for the next to be further, or nearer; an
# interpolated one is a thousand times as good
_ANEW = 3  # gaps between known derivatives in which they are interpolated anew when a further one is known
_GOOD = 0.02  # error of a prediction, in units of the state's size, that leaves the step as it is
_JUMP = 0.3  # relative change of an interval that no step of a smooth branch makes
_ACROSS = 0.2  # below this part of the parameter in the tangent, a step is measured along the curve
_AHEAD = 0.8  # least cosine of the angle between two steps
_ROUNDING = 3e-14  # relative, of what the map magnifies in a flight
_AGAIN = 1.15  # growth of an interval after which it is asked anew whether it is without bound
_SLIVER = 1.1  # a step is stretched to the end of the range if so many times it reaches there
_LEAST = 1e-9  # step
_MOST = 600  # points


@dataclass(frozen=True, eq=False)
class Walk:
    """The state of a continuation: points so far, step length, and how it ended.

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
    walker.complete()
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
        self.trail = Trail(first.u)
        self.ds = self.longest
        # on the linear plant a derivative is exact and costs next to nothing
        self.sparse, self.sparsest = 1, 1 if curve.family.plant == "linear" else _SPARSE
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
        self.trail.derive(0, D)
        if tangent is None:
            tangent = np.append(np.linalg.lstsq(D[:, :-1], -D[:, -1], rcond=1e-9)[0], 1.0)
        self.tangent = tangent / curve.length(tangent)

    def step(self) -> None:
        """One step, taken or halved."""
        curve, last = self.curve, self.points[-1]
        curve.patient(float(last.intervals.max()))
        here, u = self.trail.u[-1], self.trail.predict(self.ds, self.tangent)
        reach = last.sigma + _SLIVER * (u[-1] - last.sigma)  # to leave no sliver for another step
        lands = bool((reach - 1) * (last.sigma - 1) < 0 or (reach * last.sigma < 0))
        D = self.trail.derivative(self.trail.s[-1] + self.ds)
        direction = (u - here) / max(curve.length(u - here), 1e-300)
        row = curve.normal(direction)
        if lands:
            edge = 1.0 if (reach - 1) * (last.sigma - 1) < 0 else 0.0
            ds = self.ds * (edge - last.sigma) / (u[-1] - last.sigma)
            off = (edge - self.trail.predict(ds, self.tangent)[-1]) / (edge - last.sigma)
            ds *= float(np.clip(1 + off, 0.5, 1.5))  # near a fold, polynomials may turn before the end
            u = self.trail.predict(ds, self.tangent)
            u[-1], D = edge, self.trail.derivative(self.trail.s[-1] + ds)
        if lands or abs(direction[-1]) > _ACROSS:
            row = np.append(np.zeros(len(u) - 1), 1.0)
        found = correct(curve, u, D, row, self.bound_closure(last))
        if isinstance(found, Miss) or self.has_jumped(found.turn.intervals):
            self.closing = (
                self.closing or not isinstance(found, Miss) or found.lost is not None or is_touching(self.points)
            )
            self.shorten(found if isinstance(found, Miss) else Miss(None, found.turn))
            return
        if not lands and (found.u[-1] - 1) * (last.sigma - 1) < 0 and self.ds > 1e-4 * self.longest:
            self.ds *= 0.7 * (1 - last.sigma) / (found.u[-1] - last.sigma)  # past the end of the range
            return
        error = float(np.abs(found.u - u)[:-1].max()) / curve.weight
        back = curve.turn_of(self.tangent, found.u - last.u) < _AHEAD  # where it came from, or round a corner
        if (back and self.ds > 1e-4 * self.longest) or (error > 10 * _GOOD and self.ds > 1e-3 * self.longest):
            self.ds *= 0.4
            return
        due = lands or found.steps > 2 or len(self.points) - self.trail.known[-1] >= self.sparse
        new = make_point(curve, found, D=None if due else D)
        self.accept(new, found.best)
        if lands and self.ending is None:
            self.ending = Ending(None, f"reached {curve.family.parameter.name} = {new.value:.6g}")
        if not self.closing:
            order = min(len(self.points), self.trail.degree + 1)
            self.ds *= float(np.clip((_GOOD / max(error, 1e-9)) ** (1 / order), 0.4, 1.7))
            self.ds = min(self.ds, 4 * self.longest, self.longest / max(abs(self.tangent[-1]), 0.25))

    @staticmethod
    def bound_closure(near: Point) -> float:
        """Sufficient residual, limited by the rounding errors that the map magnifies."""
        return max(CLOSED, _ROUNDING * float(np.abs(near.D[:, :-1]).max()))

    def has_jumped(self, intervals: Array) -> bool:
        """Whether another cycle was found, or events have changed places."""
        return bool((np.abs(intervals / self.points[-1].intervals - 1) > _JUMP).any())

    def shorten(self, why: Miss) -> None:
        """Halve the step; end the branch if the step is below its minimum."""
        self.ds /= 2
        close = abs(self.curve.range.slope(self.points[-1].sigma)) * self.ds * max(abs(self.tangent[-1]), 1e-3)
        if self.ds < _LEAST or (self.closing and close < CLOSE):
            self.complete()
            self.ending = end_where_lost(self.curve, self.points, why)

    def accept(self, new: Point, best: Array) -> None:
        """Append a point to the branch and test for special points since the previous one."""
        curve = self.curve
        du = best - self.trail.u[-1]
        self.trail.add(best, curve.length(du))
        curve.weigh(new.u)
        self.tangent = du / curve.length(du)
        self.points.append(new)
        last = len(self.points) - 1
        if new.fallen:  # beyond the end; what it does there is no longer the rule's doing
            self.ending = end_at_least_interval(curve, self.points, lambda part: self.between(last - 1, part))
            self.points.pop()
            self.trail.cut(last)
            return
        if self.closing:
            self.near.add(last)
        if new.derived:
            self.use_derivative()
        self.ending = (
            self.find_growth()
            or end_by_rounding(curve, self.points, self.bound_closure(self.points[-1]))
            or round_trip(curve, self.points, self.trail, self.bound_closure(self.points[-1]))
        )

    def use_derivative(self) -> None:
        """Use the derivative at the last point to choose the step and to test for special points."""
        trail, first, last = self.trail, self.trail.known[-1], len(self.points) - 1
        D, expected = self.along(self.points[-1]), trail.derivative(trail.s[-1])
        wrong = np.abs(D - expected)[:, :-1].max() / np.abs(D).max()
        if wrong < _TRUE:
            self.sparse = min(self.sparse + 1, self.sparsest)
        elif wrong > _FALSE:
            self.sparse = max(self.sparse - 1, 1)
        self.points[-1] = replace(self.points[-1], D=D)
        trail.derive(last, D)
        for i in range(trail.known[-_ANEW - 1 :][0] + 1, last):
            if not self.points[i].derived:
                self.points[i] = update_derivative(self.curve, self.points[i], trail.derivative(trail.s[i]))
        for i in range(first, last):
            pair = self.points[i : i + 2]
            # where a family begins or ends, the multiplier that it has at ±1 leaves the circle, and is no crossing
            family = any(p.alternating for p in pair)
            before, after = (self.kappas(p, family) for p in pair)
            found = [self.crossing(test, i, family) for test in find_crossed(before, after)]
            self.specials += [special for special in found if special is not None]
        self.specials[-5:] = sorted(self.specials[-5:], key=lambda s: s.index)

    def complete(self) -> None:
        """Compute the derivative at the last point, if it is only guessed there."""
        if not self.points[-1].derived:
            self.points[-1] = add_derivative(self.curve, self.points[-1])
            self.use_derivative()

    def along(self, new: Point) -> Array:
        """The derivative of the residual, its last column from the curve's tangent where that is well conditioned."""
        D, slope = new.D.copy(), self.trail.slope()
        if abs(slope[-1]) > 0.02:
            D[:, -1] = -D[:, :-1] @ slope[:-1] / slope[-1]
            return D
        ahead = new.u.copy()
        ahead[-1] += 0.1 * (new.sigma - self.points[-2].sigma) or 1e-6
        with suppress(LostInterval):
            there, here = (self.curve.residual(u)[0] for u in (ahead, new.u))
            D[:, -1] = (there - here) / (ahead[-1] - new.sigma)
        return D

    def between(self, i: int, part: float) -> Point | None:
        """The point at a part of the way from point i to the next."""
        trail = self.trail
        u = trail.between(i, trail.s[i] + part * (trail.s[i + 1] - trail.s[i]))
        row = self.curve.normal((trail.u[i + 1] - trail.u[i]) / (trail.s[i + 1] - trail.s[i]))
        nearest = self.points[i + 1 if part > 0.5 else i]
        found = correct(self.curve, u, nearest.D, row, self.bound_closure(nearest))
        return None if isinstance(found, Miss) else make_point(self.curve, found, FINE)

    def find_growth(self) -> Ending | None:
        """Whether the interval is on its way to infinity; asked again only once it has grown further."""
        longest = float(self.points[-1].intervals.max())
        if longest < _AGAIN * self.asked:
            return None
        self.asked = longest
        self.complete()
        found = find_homoclinic_end(self.curve, self.points, self.settle)
        self.trail.cut(len(self.points))
        return found

    def settle(self, value: float, closed: float) -> Point | None:
        """The point at a value of the parameter, with the last as first guess."""
        last, sigma = self.points[-1], self.curve.range.sigma(value)
        here = self.trail.u[-1]
        u = here.copy()
        if len(self.points) > 1 and self.points[-1].sigma != self.points[-2].sigma:
            gap = (sigma - last.sigma) / (last.sigma - self.points[-2].sigma)
            u += 0.5 * gap * (here - self.trail.u[-2])
        u[-1] = sigma
        found = correct(self.curve, u, last.D, np.append(np.zeros(len(u) - 1), 1.0), closed)
        if isinstance(found, Miss):
            return None
        new = make_point(self.curve, found)
        self.trail.add(found.best, self.curve.length(found.best - here))
        self.points.append(new)
        self.trail.derive(len(self.points) - 1, new.D)
        return new

    def kappas(self, at: Point, family: bool) -> NDArray[np.complex128]:
        """κ of a point, without those that are ±1 by construction, on a family or beside one."""
        return compute_kappas(at.multipliers, self.curve.sign, self.neutral, family)

    def crossing(self, test: Test, i: int, family: bool) -> SpecialPoint | None:
        """The special point between point i and the next."""
        curve = self.curve
        left, right = self.points[i : i + 2]

        def f(at: Point) -> float:
            return evaluate_test(test, self.kappas(at, family))

        at = locate(left, right, f, lambda part: self.between(i, part), CLOSE)
        if at is None:
            at = left if abs(f(left)) < abs(f(right)) else right
        kappa = find_critical(test, self.kappas(at, family))
        if kappa is None:
            return None
        return describe_crossing(curve, test, kappa, at, i, self.turns(i))

    def turns(self, i: int) -> bool:
        """Whether the parameter turns about between point i and the next."""
        if i < 1:
            return False
        sigma, trail = [u[-1] for u in self.trail.u[i - 1 : i + 2]], self.trail
        h = 1e-3 * (trail.s[i + 1] - trail.s[i])
        near = interpolate(np.array(trail.s[i - 1 : i + 2]), np.array(sigma)[:, None], trail.s[i + 1] - h)
        before, after = sigma[1] - sigma[0], sigma[2] - float(near[0])
        return bool(before * (sigma[2] - sigma[1]) < 0 or before * after < 0)
