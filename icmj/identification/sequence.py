"""Identification from all events since a known start, by least squares on simulated events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from icmj.base.array import Array
from icmj.case.case import Case, PlantKind, simulate
from icmj.errors import IcmjError
from icmj.identification.observed import Observed
from icmj.identification.unknown import Unknown

_POINTS = 41  # of the interval in which it is sought
_FIRST = 3  # events that are compared there: later ones are too far off where the value is
_LATE = 1.0  # residual of an event that does not come, in mean intervals


@dataclass(frozen=True)
class Fit:
    """The best value, the half width of its 95 % confidence, and the residual of an event in mean intervals."""

    value: float
    error: float
    residual: float


class Sequence:
    """The simulated events for a value, compared with the observed ones."""

    def __init__(self, unknown: Unknown, observed: Observed, plant: PlantKind) -> None:
        self._unknown, self._times, self._plant = unknown, observed.times, plant
        self._scale = float(np.mean(observed.intervals))
        self._like: Case | None = None

    def residuals(self, value: float, count: int, plant: PlantKind) -> Array:
        """The error of each of the first ``count`` events, in mean intervals."""
        times = self._times[:count]
        duration = float(times[-1] + self._scale)
        case = self._unknown.case(value, self._like, **{"simulation.duration": duration})
        if case is None:
            return np.full(count, _LATE)
        self._like = case
        try:
            found = simulate(case, plant).events.t[:count]
        except IcmjError:
            return np.full(count, _LATE)
        off = np.full(count, _LATE)
        off[: len(found)] = (found - times[: len(found)]) / self._scale
        return off

    def fit(self) -> Fit:
        """The value whose events are nearest to those observed."""
        grid = np.linspace(self._unknown.low, self._unknown.high, _POINTS)
        count = min(_FIRST, len(self._times))
        coarse = [float(np.sum(self.residuals(float(value), count, "linear") ** 2)) for value in grid]
        best = int(np.argmin(coarse))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
        value = self._least(float(grid[best]), count, low, high).x[0]
        # one event more and the next: each is where it is, and closer told, from what the ones before it told
        found = None
        for more in sorted({min(2 * count, len(self._times)), len(self._times)}):
            found = self._least(value, more, low, high, self._plant)
            value = found.x[0]
        assert found is not None
        n = len(found.fun)
        size = float(np.sqrt(np.sum(found.fun**2) / max(n - 1, 1)))
        slope = float(np.linalg.norm(found.jac))
        size = max(size, 1e-9)  # as far as times of events are exact
        error = size / slope * float(student.ppf(0.975, max(n - 1, 1))) if slope > 0 else float("inf")
        return Fit(float(value), error, size)

    def _least(self, value: float, count: int, low: float, high: float, plant: PlantKind = "linear"):  # type: ignore[no-untyped-def]
        return least_squares(
            lambda at: self.residuals(float(at[0]), count, plant),
            [np.clip(value, low + 1e-9, high - 1e-9)],
            bounds=(low, high),
            diff_step=1e-6,
            xtol=1e-12,
            ftol=1e-12,
            max_nfev=25,
        )
