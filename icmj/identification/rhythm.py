"""The rhythm of a motion that has settled, or nearly.

Its open-loop interval, and whether it is mirrored, from events or outputs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline, make_splrep
from scipy.optimize import minimize_scalar

from icmj.base.array import Array, argmax_abs
from icmj.identification.observed import Observed
from icmj.theory.prediction import PredictedOrbit, Prediction

NEAR = 0.1  # relative: intervals that agree so well may be on their way to a cycle
_LEAST = 3  # of them
_FAR = 10.0  # standard deviations of the error of a time: intervals differ by no more for it
_CLOSED = 0.02  # of the size of the output: what may be left of a motion that repeats itself
_NEAR = 0.5  # the same between two shifts that are looked at
SPAN = 0.4  # part of the record over which it has to


@dataclass(frozen=True)
class Rhythm:
    """A motion that has settled, or nearly.

    Attributes:
        interval: open-loop interval [s].
        sign: +1; −1 if each interval mirrors the one before; 0 where that was not observed.
        count: intervals that are near to it.
        sampled: whether it is the shift after which outputs repeat themselves.
    """

    interval: float
    sign: int
    count: int
    sampled: bool = False

    @property
    def readings(self) -> tuple[Rhythm, ...]:
        """What it may be: outputs that repeat themselves are mirrored twice, where half of it does not repeat yet."""
        if not self.sampled or self.sign < 0:
            return (self,)
        return self, replace(self, interval=self.interval / 2, sign=-1)

    def find_orbit(self, prediction: Prediction) -> PredictedOrbit | None:
        """The attracting orbit whose interval is nearest, of this sign where it was observed; ``None`` without one."""
        like = [one for one in prediction.orbits if one.verdict == "attracting" and one.orbit.sign * self.sign >= 0]
        return min(like, key=lambda one: abs(np.log(one.crossing.delta / self.interval)), default=None)


def rhythm(observed: Observed) -> Rhythm | None:
    """The rhythm at the end of a motion, or ``None`` where it has none."""
    return _rhythm_of_events(observed) if len(observed.times) else _rhythm_of_samples(observed)


def _rhythm_of_events(observed: Observed) -> Rhythm | None:
    intervals = np.diff(observed.times)
    slack = _FAR * observed.jitter
    good = 0
    # from the end on, as long as they agree with the last ones
    for first in range(len(intervals) - _LEAST, -1, -1):
        tail = intervals[first:]
        if np.ptp(tail) > NEAR * tail.mean() + slack:
            break
        good = len(tail)
    if not good:
        return None
    # the later half, to be as near to the cycle as may be; of a mirrored one intervals may alternate
    n = max(_LEAST, 2 * (good // 4))
    return Rhythm(float(intervals[-n:].mean()), _sign(observed.outputs), good)


def _sign(outputs: Array) -> int:
    """Whether successive events mirror each other, from the output that says it most clearly."""
    if not outputs.shape[1] or len(outputs) < 2:
        return 0
    last = outputs[-min(len(outputs), 6) :]
    same = np.sum(last[1:] * last[:-1], axis=0) / np.maximum(np.sum(last[1:] ** 2, axis=0), 1e-300)
    clearest = float(same[argmax_abs(same)])
    return 0 if abs(clearest) < 0.5 else int(np.sign(clearest))


def _rhythm_of_samples(observed: Observed) -> Rhythm | None:
    """The shift after which the outputs repeat, unchanged or mirrored, in the last part of the record."""
    t, y = observed.t, observed.y
    stated = bool(observed.reading or observed.timing)
    curve = _smooth(t, y) if stated else CubicSpline(t, y)
    end, span = t[-1], SPAN * (t[-1] - t[0])
    at = np.linspace(end - span, end, 800)
    now = curve(at)
    size = np.sqrt(np.mean((now - now.mean(axis=0)) ** 2))
    unsure = np.sqrt(np.mean(observed.unsure(now.std(axis=0)) ** 2))
    rate = np.sqrt(np.mean(curve(at, 1) ** 2))
    # what errors of readings and times leave of a motion that repeats itself
    left_over = np.sqrt(2 * (unsure**2 + (rate * observed.jitter) ** 2)) / size
    closed = float(np.hypot(_CLOSED, left_over if stated else 0.0))

    def left(shift: float, sign: int) -> float:
        return float(np.sqrt(np.mean((curve(at - shift) - sign * now) ** 2)) / size)

    shifts = np.arange(4 * (t[-1] - t[0]) / len(t), (t[-1] - t[0]) * (1 - SPAN) * 0.98, 2 * (t[-1] - t[0]) / len(t))
    found = [each for sign in (1, -1) if (each := _first(left, shifts, sign, closed)) is not None]
    if not found:
        return None
    shift, sign = min(found)
    return Rhythm(shift, sign, max(1, int(span / shift)), sampled=True)


def _smooth(t: Array, y: Array) -> CubicSpline:
    """The outputs smoothed by splines, whose residual matches the noise level estimated from third differences."""
    fine = np.linspace(t[0], t[-1], 4 * len(t))
    errors = np.std(np.diff(y, 3, axis=0), axis=0) / np.sqrt(20)
    smooth = (make_splrep(t, column, s=len(t) * error**2) for column, error in zip(y.T, errors, strict=True))
    return CubicSpline(fine, np.column_stack([each(fine) for each in smooth]))


def _first(left, shifts: Array, sign: int, closed: float) -> tuple[float, int] | None:  # type: ignore[no-untyped-def]
    """The first shift after which the outputs repeat themselves with this sign."""
    gap = np.array([left(shift, sign) for shift in shifts])
    apart = False
    for i in range(1, len(shifts) - 1):
        apart = apart or gap[i] > 10 * _CLOSED + closed  # near 0 every motion repeats itself
        if apart and gap[i] <= min(gap[i - 1], gap[i + 1]) and gap[i] < _NEAR:
            # errors of readings make a valley rough: its deepest place
            beyond = np.flatnonzero(gap[i:] > gap[i] + 2 * closed)
            valley = i + int(np.argmin(gap[i : i + int(beyond[0])] if len(beyond) else gap[i:-1]))
            bounds = (shifts[valley - 1], shifts[valley + 1])
            best = minimize_scalar(left, args=(sign,), bounds=bounds, method="bounded", options={"xatol": 1e-10})
            if best.fun < closed:
                return float(best.x), sign
    return None
