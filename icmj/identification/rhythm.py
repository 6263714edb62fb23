"""The rhythm of a settled motion: its open-loop interval, and whether it is mirrored, from events or outputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from icmj.base.array import Array
from icmj.identification.observed import Observed

_SETTLED = 1e-3  # relative: intervals that agree so well have settled
_LEAST = 3  # of them
_CLOSED = 0.02  # of the size of the output: what may be left of a motion that repeats itself
_NEAR = 0.5  # the same between two shifts that are looked at
_SPAN = 0.4  # part of the record over which it has to


@dataclass(frozen=True)
class Rhythm:
    """A settled motion.

    Attributes:
        interval: open-loop interval [s].
        error: half width of its 95 % confidence [s].
        sign: +1; −1 if each interval mirrors the one before; 0 where that was not observed.
        count: intervals that it is taken from.
    """

    interval: float
    error: float
    sign: int
    count: int


def rhythm(observed: Observed) -> Rhythm | None:
    """The rhythm at the end of a motion, or ``None`` where it has none."""
    return _of_events(observed) if len(observed.times) else _of_samples(observed.t, observed.y)


def _of_events(observed: Observed) -> Rhythm | None:
    intervals = np.diff(observed.times)
    slack = 2 * observed.resolution
    good = 0
    # from the end on, as long as they agree with the last ones
    for first in range(len(intervals) - _LEAST, -1, -1):
        tail = intervals[first:]
        if np.ptp(tail) > _SETTLED * tail.mean() + slack:
            break
        good = len(tail)
    if not good:
        return None
    # the later half, to be as near to the cycle as may be
    tail = intervals[len(intervals) - max(_LEAST, good // 2) :]
    scatter = tail.std(ddof=1) / np.sqrt(len(tail)) * student.ppf(0.975, len(tail) - 1)
    rounding = observed.resolution / len(tail)
    return Rhythm(float(tail.mean()), float(np.hypot(scatter, rounding)), _sign(observed.outputs), len(tail))


def _sign(outputs: Array) -> int:
    """Whether successive events mirror each other, from the output that says it most clearly."""
    if not outputs.shape[1] or len(outputs) < 2:
        return 0
    last = outputs[-min(len(outputs), 6) :]
    same = np.sum(last[1:] * last[:-1], axis=0) / np.maximum(np.sum(last[1:] ** 2, axis=0), 1e-300)
    clearest = float(same[np.abs(same).argmax()])
    return 0 if abs(clearest) < 0.5 else int(np.sign(clearest))


def _of_samples(t: Array, y: Array) -> Rhythm | None:
    """From when on the outputs repeat themselves, as they are or mirrored, over the last part of the record."""
    curve = CubicSpline(t, y)
    end, span = t[-1], _SPAN * (t[-1] - t[0])
    at = np.linspace(end - span, end, 800)
    now = curve(at)
    size = np.sqrt(np.mean((now - now.mean(axis=0)) ** 2))

    def left(shift: float, sign: int) -> float:
        return float(np.sqrt(np.mean((curve(at - shift) - sign * now) ** 2)) / size)

    shifts = np.arange(4 * (t[-1] - t[0]) / len(t), (t[-1] - t[0]) * (1 - _SPAN) * 0.98, 2 * (t[-1] - t[0]) / len(t))
    found = [each for sign in (1, -1) if (each := _first(left, shifts, sign)) is not None]
    if not found:
        return None
    shift, sign = min(found)
    # from two halves of the part, how well it is known
    half = [minimize_scalar(_part(curve, a, sign), bounds=(0.98 * shift, 1.02 * shift), method="bounded").x
            for a in np.split(at, 2)]  # fmt: skip
    return Rhythm(shift, float(max(abs(half[0] - half[1]), 1e-9 * shift)), sign, max(1, int(span / shift)))


def _first(left, shifts: Array, sign: int) -> tuple[float, int] | None:  # type: ignore[no-untyped-def]
    """The first shift after which the outputs repeat themselves with this sign."""
    gap = np.array([left(shift, sign) for shift in shifts])
    apart = False
    for i in range(1, len(shifts) - 1):
        apart = apart or gap[i] > 10 * _CLOSED  # near 0 every motion repeats itself
        if apart and gap[i] <= min(gap[i - 1], gap[i + 1]) and gap[i] < _NEAR:
            best = minimize_scalar(left, args=(sign,), bounds=(shifts[i - 1], shifts[i + 1]), method="bounded",
                                   options={"xatol": 1e-10})  # fmt: skip
            if best.fun < _CLOSED:
                return float(best.x), sign
    return None


def _part(curve: CubicSpline, at: Array, sign: int):  # type: ignore[no-untyped-def]
    now = curve(at)
    return lambda shift: float(np.mean((curve(at - shift) - sign * now) ** 2))
