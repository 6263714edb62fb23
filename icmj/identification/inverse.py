"""Inversion of the interval: all values, on every branch, whose predicted interval is the observed one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from icmj.case.case import Case
from icmj.cycle.cycle import find_cycle
from icmj.errors import IcmjError
from icmj.identification.rhythm import Rhythm
from icmj.identification.unknown import Unknown

if TYPE_CHECKING:
    from icmj.case.case import PredictedCase

_POINTS = 33  # of the interval in which it is sought
_SAME = 1e-6  # relative: a root at which the interval is not the one observed is a jump


@dataclass(frozen=True)
class Candidate:
    """A value that explains the observed interval, its uncertainty due to that of the interval, and the sign."""

    value: float
    error: float
    sign: int


class Inverse:
    """The map from the unknown to the predicted interval, with a cache of its values."""

    def __init__(self, unknown: Unknown) -> None:
        self.unknown = unknown
        self._known: dict[float, tuple[float, int]] = {}
        self._like: Case | None = None

    @classmethod
    def up_to(cls, unknown: Unknown, rhythm: Rhythm) -> Inverse:
        """A map whose crossings are searched beyond the observed interval."""
        return cls(replace(unknown, longest=2.0 ** np.ceil(np.log2(1.5 * rhythm.interval))))

    def reaches(self, interval: float) -> bool:
        """Whether an interval [s] would be found."""
        return max(self.unknown.longest or 0.0, self.unknown.run.analysis.delta_max) > 1.2 * interval

    def rate(self, value: float) -> tuple[float, int]:
        """1/Δ_crit [1/s] and the sign of λ; 0 where intervals grow without bound, NaN where no cycle attracts."""
        if value not in self._known:
            case = self.unknown.case(value, self._like)
            self._like = case or self._like
            self._known[value] = _rate(case)
        return self._known[value]

    def candidates(self, rhythm: Rhythm) -> list[Candidate]:
        """Every value whose predicted cycle has this interval and, where it was observed, this sign."""
        grid = np.linspace(self.unknown.low, self.unknown.high, _POINTS)
        return [candidate for a, b in pairwise(grid) for candidate in self._between(float(a), float(b), rhythm)]

    def _between(self, a: float, b: float, rhythm: Rhythm) -> Iterator[Candidate]:
        (rate_a, sign_a), (rate_b, sign_b) = self.rate(a), self.rate(b)
        if not np.isfinite(rate_a + rate_b):
            return
        if sign_a and sign_b and sign_a != sign_b:  # over a value that the model has right, where intervals grow
            middle = (a + b) / 2
            if abs(b - a) > 1e-9 * max(1.0, abs(a)):
                yield from self._between(a, middle, rhythm)
                yield from self._between(middle, b, rhythm)
            return
        sign = sign_a or sign_b
        target = 1 / rhythm.interval
        if not sign or (rhythm.sign and sign != rhythm.sign) or (rate_a - target) * (rate_b - target) > 0:
            return

        def off(value: float) -> float:
            rate = self.rate(value)[0]
            return (rate if np.isfinite(rate) else 0.0) - target

        value = float(brentq(off, a, b, xtol=1e-12, rtol=1e-14))
        if abs(off(value)) < _SAME * target:
            yield Candidate(value, self._error(value, rhythm, b - a), sign)

    def slope(self, value: float, step: float) -> float:
        """dΔ_crit/dvalue [s]; infinite where there is no cycle beside it."""
        rates = [self.rate(value + side * step)[0] for side in (1, -1)]
        if not all(np.isfinite(rates)) or min(rates) <= 0:
            return float("inf")
        return (1 / rates[0] - 1 / rates[1]) / (2 * step)

    def _error(self, value: float, rhythm: Rhythm, width: float) -> float:
        slope = self.slope(value, 1e-4 * width)
        return 0.0 if not np.isfinite(slope) else rhythm.error / abs(slope) if slope else float("inf")


def refined(inverse: Inverse, candidate: Candidate, rhythm: Rhythm) -> Candidate:
    """The candidate by the exact cycle of the engine's loop, not the linear theory's; as it is, if there is none."""
    value = candidate.value
    try:
        for _ in range(3):
            case = inverse.unknown.case(value)
            if case is None:
                return candidate
            missing = rhythm.interval - find_cycle(case, "mujoco").interval
            slope = inverse.slope(value, 1e-5)
            if not np.isfinite(slope) or slope == 0:
                return candidate
            value += missing / slope
            if abs(missing) < max(1e-10 * rhythm.interval, 0.01 * rhythm.error):
                break
    except IcmjError:
        return candidate
    return Candidate(value, candidate.error, candidate.sign)


def _rate(case: PredictedCase | None) -> tuple[float, int]:
    if case is None:
        return float("nan"), 0
    found = case.prediction
    if found.delta_crit is None or found.eigenvalue is None:
        return 0.0, 0
    if not found.cycle or found.verdict != "attracting":
        return float("nan"), 0
    return 1 / found.delta_crit, int(np.sign(found.eigenvalue.real))
