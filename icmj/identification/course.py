"""The motion that a value of the unknown predicts, laid on the one observed by least squares.

What is left of times and outputs counts in standard deviations of their errors. This gives the value and its
confidence, however slowly the motion settles, and tells whether a value that explains the intervals also explains
amplitude and shape: the sum of squares has, where only these errors are between the two, a chi-square distribution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2
from scipy.stats import t as student

from icmj.base.array import Array, is_between
from icmj.case.case import Case, PlantKind, Theory, simulate
from icmj.errors import IcmjError
from icmj.identification.observed import EXACT, SETTLED, Observed
from icmj.identification.rhythm import SPAN, Rhythm
from icmj.identification.unknown import Unknown
from icmj.simulation.simulation import Simulation
from icmj.theory.orbit import Orbit

LEVEL = 0.002
"""Probability below which nothing fits; so often is a motion refused that the run file describes."""
_STEP = 1e-4  # of the unit of each number: differences that are derivatives
_TRIES = 30
_HOPELESS = 100.0  # variances: what is left where no small step helps any more
MANY = 32  # intervals, which tell enough of a motion whatever is free
_SMALL = 1e-5  # of the sum of squares, and of the variance of an error: what another step has to win
_PHASES = 48  # at which the predicted motion is laid first


@dataclass(frozen=True)
class Agreement:
    """The agreement of the predicted motion with the observed one.

    Attributes:
        probability: that errors of times and outputs alone would make it agree less.
        off: root mean square of what is left of the outputs, relative to that of the outputs; NaN without outputs.
        observed, predicted: largest magnitudes of the outputs that were compared [their unit], shape (n_y,).
        whole: whether outputs were compared, and not times of events alone.
    """

    probability: float
    off: float = float("nan")
    observed: tuple[float, ...] = ()
    predicted: tuple[float, ...] = ()

    @property
    def fits(self) -> bool:
        """Whether the value is compatible with the observation."""
        return self.probability >= LEVEL

    @property
    def words(self) -> str:
        """The differences from the prediction, in words."""
        if not self.predicted:
            return "the times of the events scatter by more than their errors"
        if not np.isfinite(self.off):
            return "the motion that it predicts cannot be simulated"
        peaks = (", ".join(f"{value:.3g}" for value in values) for values in (self.predicted, self.observed))
        return "the outputs are off by {:.2g} % of their size (predicted peak {}, observed {})".format(
            100 * self.off, *peaks
        )


@dataclass(frozen=True)
class Fit:
    """The best value near a first one.

    Attributes:
        value, error: the value, and the half width of its 95 % confidence; infinite where nothing depends on it.
        cost: sum of squares of what is left, in standard deviations of the errors.
        off: root mean square of what is left of the times of events, in mean intervals; 0 of samples.
        agreement: that of the motion.
    """

    value: float
    error: float
    cost: float
    off: float
    agreement: Agreement


class Course:
    """The simulated motion for a value, laid on the observed one by least squares.

    From a known start on, nothing but the value is free. Else the motion begins at an event near the predicted orbit:
    its time is free, and the state after it, and with it the part of each multiplier in what is observed. What the
    motion does not tell of this state is held near the orbit, by a standard deviation of the size of the orbit.
    """

    def __init__(self, unknown: Unknown, observed: Observed, plant: PlantKind, found: Rhythm | None = None) -> None:
        self._unknown, self._plant, self._observed = unknown, plant, observed
        self._found, self._whole, self._events = found, found is None, len(observed.times) > 0
        if self._events:
            first = 0 if found is None else -(found.count + 1)
            self._t, self._y = observed.times[first:], observed.outputs[first:]
        else:
            kept = is_between(observed.t, observed.t[-1] - SPAN * (observed.t[-1] - observed.t[0]))
            self._t, self._y = observed.t[kept], observed.y[kept]
        self._interval = found.interval if found else float(np.mean(observed.intervals))
        self._exact = max(observed.jitter, EXACT * self._interval)
        # events need not come more evenly than a rhythm that has settled
        self._loose = max(observed.jitter, SETTLED * self._interval) if self._events else observed.jitter
        self._like: Case | None = None
        self._near = lru_cache(maxsize=2)(self._find_near)  # of the value and of one a step away
        self._ran: tuple[tuple[float, ...], Simulation | None] = ((), None)

    def fit(self, value: float, counts: tuple[int, ...] = (), most: float = np.inf) -> Fit | None:
        """The best value near this one, from the first ``counts`` events, and then from all that was observed.

        ``None`` without one, or where first events are farther off than ``most`` mean intervals.
        """
        best: Fit | None = None
        for count in (*(each for each in counts if each < len(self._t)), len(self._t)):
            best = self._least(*self._start(best.value if best else value, count), count)
            if best is None or best.off > most:
                return None
        return best

    def distance(self, value: float, count: int) -> float:
        """Sum of squares of the first ``count`` events since a known start, in mean intervals."""
        left = self._compare(np.array([value]), 1, count)
        return float(count) if left is None else float(np.sum((left[0] * self._exact / self._interval) ** 2))

    def fewest(self, value: float) -> int:
        """The intervals that leave as much to be compared as they tell of what is free beside the value."""
        near = self._near(value)
        return 2 * (2 + (0 if near is None else len(near[2].x_bar)))

    def _start(self, value: float, count: int) -> tuple[Array, int]:
        """The value with what is free beside it, time of the first event and state, and the side that is nearer."""
        near = None if self._whole else self._near(value)
        if near is None:
            return np.array([value]), 1
        back = np.zeros(1) if self._events else np.arange(0.25, 1.25, 1 / _PHASES)
        begins = [np.array([value, self._t[0] - each * self._interval, *0 * near[2].x_bar]) for each in back]
        choices = ((begin, side) for side in (1, -1) for begin in begins)
        return min(choices, key=lambda each: self._cost(self._vector(each[0], each[1], count)))

    def _find_near(self, value: float) -> tuple[Case, Theory, Orbit] | None:
        """The case with the predicted orbit that is nearest to the rhythm; of those that attract, if any does."""
        case = self._case(value)
        if case is None or case.theory is None or case.theory.prediction.orbit is None:
            return None
        nearest = self._found.find_orbit(case.theory.prediction) if self._found else None
        return case, case.theory, nearest.orbit if nearest else case.theory.prediction.orbit

    def _case(self, value: float, **changes: Any) -> Case | None:
        case = self._unknown.case(value, self._like, **changes)
        self._like = case or self._like
        return case

    def _simulate(self, at: Array, side: int, count: int) -> Simulation | None:
        """The motion for a value, from the known start, or from a state right after an event at t = 0."""
        key = (at[0], *at[2:], side, count)
        if self._ran[0] != key:
            try:
                self._ran = key, self._run(at[0], side * at[2:], side, count)
            except IcmjError:
                self._ran = key, None
        return self._ran[1]

    def _run(self, value: float, state: Array, side: int, count: int) -> Simulation | None:
        if self._whole:
            # where intervals are longer the same number of events takes longer
            duration = 1.1 * float(self._t[count - 1] - self._observed.begin) + 2 * self._interval
            case = self._case(value, **{"simulation.duration": duration})
            return None if case is None else simulate(case, self._plant)
        if (near := self._near(value)) is None:
            return None
        case, theory, orbit = near
        step = min(case.settings.record_interval, self._interval / 200)
        case = replace(case, settings=replace(case.settings, disturbance=(), record_interval=step))
        start = theory.system.start(side * orbit.x_bar + _sizes(orbit) * state)
        length = float(self._t[count - 1] - self._t[0]) + 2.5 * self._interval
        return simulate(case, self._plant, start=start, duration=length)

    def _compare(self, at: Array, side: int, count: int) -> tuple[Array, Array, Array, Array] | None:
        """What is left of times and outputs, in standard deviations, and the predicted outputs and their peaks."""
        run = self._simulate(at, side, count)
        if run is None or len(run.t) < 4:
            return None
        when, times = self._t[:count] - (0.0 if self._whole else at[1]), np.zeros(0)
        if self._events:
            events = run.events.t if self._whole else np.append(0.0, run.events.t)
            if len(events) < count:
                return None
            times, when = (when - events[:count]) / self._exact, events[:count]
        y = self._y[:count]
        curve = CubicSpline(run.t, run.y[:, : y.shape[1]])
        # not of what comes before: errors in proportion to it would explain anything
        peak, seen = np.abs(run.y[run.t >= min(when[0], run.t[-1])]).max(axis=0)[: y.shape[1]], curve(when)
        sigma = np.hypot(self._observed.unsure(peak), self._loose * curve(when, 1))
        return times, (y - seen) / np.maximum(sigma, 1e-12 * peak + 1e-300), seen, peak

    def _vector(self, at: Array, side: int, count: int) -> Array | None:
        left = self._compare(at, side, count)
        return None if left is None else np.concatenate([left[0], left[1].ravel(), at[2:]])

    @staticmethod
    def _cost(left: Array | None) -> float:
        return np.inf if left is None else float(left @ left)

    def _least(self, at: Array, side: int, count: int) -> Fit | None:
        """Steps of Gauss and Newton, halved where they lead up, until the next is small beside the errors."""
        unit = np.full(len(at), 0.1)
        unit[:2] = np.array([1e-2 * (self._unknown.high - self._unknown.low), 1e-2 * self._interval])[: len(at)]
        left = self._vector(at, side, count)
        for _ in range(_TRIES):
            if left is None:
                return None
            moved = [self._vector(at + step, side, count) for step in np.diag(_STEP * unit)]
            slopes = np.column_stack([(each - left) / _STEP if each is not None else 0 * left for each in moved])
            step = np.linalg.lstsq(slopes, -left, rcond=None)[0]
            if np.sum((slopes @ step) ** 2) < _SMALL + _SMALL * (left @ left):
                break
            for part in 0.5 ** np.arange(8):
                there = at + part * step * unit
                there[0] = np.clip(there[0], self._unknown.low, self._unknown.high)
                further = self._vector(there, side, count)
                if self._cost(further) < self._cost(left):
                    break
            else:
                break
            stuck = self._cost(further) > max(_HOPELESS * len(left), 0.8 * self._cost(left))
            at, left = there, further
            if stuck:
                break
        found = self._compare(at, side, count)
        if found is None:
            return None
        times, outputs, seen, peak = found
        # what the value alone does, and how many numbers the motion has told
        own, others = slopes[:, 0], slopes[:, 1:]
        told = float(np.linalg.norm(own - others @ np.linalg.lstsq(others, own, rcond=None)[0]))
        known = float(np.sum(np.linalg.qr(slopes)[0][: times.size + outputs.size] ** 2))
        spare = max(times.size - known, 1.0)
        off = float(np.sqrt(np.sum(times**2) / spare)) if times.size else 0.0
        error = unit[0] / told * max(1.96, float(student.ppf(0.975, spare)) * off) if told > 0 else np.inf
        square = float(np.sum((times * self._exact / max(self._loose, self._exact)) ** 2) + np.sum(outputs**2))
        more: dict[str, Any] = {}
        if outputs.size:
            y = self._y[:count]
            more = {"off": float(np.sqrt(np.sum((y - seen) ** 2) / np.sum(y**2)))}
            more |= {
                "observed": tuple(np.abs(y).max(axis=0)),
                "predicted": tuple(peak if not times.size else np.abs(seen).max(axis=0)),
            }
        how = Agreement(float(chi2.sf(square, max(times.size + outputs.size - known, 1.0))), **more)
        return Fit(float(at[0]), float(error), self._cost(left), off * self._exact / self._interval, how)


def _sizes(orbit: Orbit) -> Array:
    """The largest magnitude on the orbit of each entry of x̄."""
    size = np.abs(orbit.X).max(axis=0)[: len(orbit.x_bar)]
    return np.asarray(np.maximum(size, 1e-3 * size.max()))
