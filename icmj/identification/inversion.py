"""Every value of the unknown, on every branch, whose predicted interval is the one observed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from icmj.base.array import Array
from icmj.case.case import Case
from icmj.identification.rhythm import NEAR, Rhythm
from icmj.identification.unknown import Unknown

POINTS = 33  # of the interval in which it is sought
_SAME = 1e-6  # relative: a root at which the interval is not the one observed is a jump
_NARROW = 1e-8  # of a cell: what is so narrow is halved no further
_APART = 1e-4  # of a cell: what is nearer to each other is one value
_EVEN = 1e-10  # relative: an interval that varies less is at an extremum
_FAR = 0.3  # of the interval and of its rise: farther beyond the ends of a cell it does not bend
_STRAIGHT = 0.1  # of the rise: so far from a straight line the interval has no extremum in between


def find_minima(values: Array) -> list[int]:
    """Where values on a grid are less than beside it, the least first; of equal neighbours the last."""
    left, right = np.append(np.inf, values[:-1]), np.append(values[1:], np.inf)
    return sorted(np.flatnonzero((values <= left) & (values < right)).tolist(), key=lambda i: float(values[i]))


class Inverse:
    """The map from the unknown to the predicted interval, with a cache of its values."""

    def __init__(self, unknown: Unknown) -> None:
        self.unknown = unknown
        self._known: dict[float, tuple[tuple[float, int], ...]] = {}
        self._like: Case | None = None

    @classmethod
    def up_to(cls, unknown: Unknown, rhythm: Rhythm) -> Inverse:
        """A map whose crossings are searched beyond the observed interval."""
        return cls(replace(unknown, longest=2.0 ** np.ceil(np.log2(1.5 * rhythm.interval))))

    def reaches(self, interval: float) -> bool:
        """Whether an interval [s] would be found."""
        return max(self.unknown.longest or 0.0, self.unknown.run.analysis.delta_max) > 1.2 * interval

    def rate(self, value: float, rhythm: Rhythm | None = None) -> tuple[float, int]:
        """1/Δ [1/s] and the sign of λ of the attracting orbit that is nearest to a rhythm, or else of that at Δ_crit.

        It is 0 where intervals grow without bound, and NaN where no orbit attracts.
        """
        if value not in self._known:
            case = self.unknown.case(value, self._like)
            self._like = case or self._like
            self._known[value] = _list_rates(case)
        known = self._known[value]
        if rhythm is not None:
            like = [one for one in known if one[0] > 0 and one[1] * rhythm.sign >= 0]
            known = tuple(sorted(like, key=lambda one: abs(np.log(one[0] * rhythm.interval)))) or known
        return known[0] if known else (float("nan"), 0)

    def candidates(self, rhythm: Rhythm) -> list[float]:
        """Every value whose predicted cycle has this interval and, where it was observed, this sign."""
        grid = np.linspace(self.unknown.low, self.unknown.high, POINTS)
        found: list[float] = []
        for a, b in pairwise(grid):
            for value in self._between(float(a), float(b), rhythm):
                if all(abs(value - other) > _APART * (b - a) for other in found):
                    found.append(value)
        return found

    def nearest(self, rhythm: Rhythm) -> list[float]:
        """Values of the grid, none beside a candidate, whose interval is near that of a motion still on its way."""
        grid = np.linspace(self.unknown.low, self.unknown.high, POINTS)
        rates, signs = np.transpose([self.rate(float(value), rhythm) for value in grid])
        off = np.where(signs * rhythm.sign < 0, np.nan, np.abs(rates * rhythm.interval - 1))
        near = [float(grid[i]) for i in sorted(find_minima(np.nan_to_num(off, nan=np.inf))) if off[i] < NEAR]
        known, cell = self.candidates(rhythm), grid[1] - grid[0]
        return [value for value in near if all(abs(value - other) > cell for other in known)]

    def _between(self, a: float, b: float, rhythm: Rhythm, part: float = 1.0) -> Iterator[float]:
        """The values in a ``part`` of a cell, halved where the nearest interval is not nearly straight in it.

        So are found the ends of the region where a cycle attracts, jumps of Δ_crit, values that the model has right,
        where intervals grow, and extrema, with what lies beside each of them.
        """
        target, middle, narrow = 1 / rhythm.interval, (a + b) / 2, part < _NARROW
        (first, sign), (last, other) = self.rate(a, rhythm), self.rate(b, rhythm)
        smooth = np.isfinite(first + last) and sign == other
        if smooth:
            rise, missed = abs(last - first), max(min(first, last) - target, target - max(first, last))
            if not sign or sign == -rhythm.sign or missed > _FAR * (5 * rise + part * target):
                return
            bend = abs(self.rate(middle, rhythm)[0] - (first + last) / 2)
            if missed > 2 * bend + _EVEN * target:
                return
            if narrow or bend <= _STRAIGHT * rise + _EVEN * target:
                if (first - target) * (last - target) <= 0:
                    middle = float(
                        brentq(lambda at: np.nan_to_num(self.rate(at, rhythm)[0]) - target, a, b, xtol=1e-12)
                    )
                if abs(self.rate(middle, rhythm)[0] - target) < _SAME * target:
                    yield middle
                return
        if not narrow and (smooth or np.isfinite([first, last, self.rate(middle, rhythm)[0]]).any()):
            yield from self._between(a, middle, rhythm, part / 2)
            yield from self._between(middle, b, rhythm, part / 2)

    def slope(self, value: float, step: float, rhythm: Rhythm | None = None) -> float:
        """dΔ/dvalue [s] of the orbit that is nearest to a rhythm; infinite where there is none beside it."""
        rates = [self.rate(value + side * step, rhythm)[0] for side in (1, -1)]
        if not all(np.isfinite(rates)) or min(rates) <= 0:
            return float("inf")
        return (1 / rates[0] - 1 / rates[1]) / (2 * step)


def _list_rates(case: Case | None) -> tuple[tuple[float, int], ...]:
    """1/Δ [1/s] and the sign of λ of each attracting orbit, that at Δ_crit first; (0, 0) without a crossing at ±1."""
    if case is None or case.theory is None:
        return ()
    found = case.theory.prediction
    if found.delta_crit is None:
        return ((0.0, 0),)
    attracting = [one for one in found.orbits if one.verdict == "attracting"]
    attracting.sort(key=lambda one: one.crossing.delta != found.delta_crit)
    return tuple((1 / one.crossing.delta, one.orbit.sign) for one in attracting)
