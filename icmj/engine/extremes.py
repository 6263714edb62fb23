"""Extremes of the outputs between events, to better than the integrator's order.

Around every sample that is higher (lower) than its neighbours the polynomial through the nearest samples is maximised.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from icmj.base.array import Array
from icmj.base.instants import ONE_INSTANT

POINTS = 6  # a quintic: its sixth-order error stays below that of the fourth-order integrator

MANY = 20_000  # samples that are looked at together, which is quicker than few at a time
Jumps = Callable[[float, float], Array]


def find_extremes(t: Array, y: Array, spans: np.ndarray) -> tuple[Array, Array]:
    """Largest and smallest value of each signal y(t) in each span, between samples too.

    The ends of a span count as they are. Samples much closer together than the others are thinned, for a polynomial
    through them would magnify rounding. Shapes (M,), (M, n) → (K, n), (K, n).

    Args:
        t: sampling times [s], rising.
        y: samples of the signals, which are smooth within each span.
        spans: first and last sample of each span, shape (K, 2).
    """
    length = spans[:, 1] - spans[:, 0] + 1
    starts = np.cumsum(length) - length  # where each span begins, with all of them one after the other
    of = np.repeat(np.arange(len(spans)), length)
    samples = np.arange(len(of)) + (spans[:, 0] - starts)[of]
    t, y = t[samples], y[samples]
    high, low = np.maximum.reduceat(y, starts), np.minimum.reduceat(y, starts)
    ends = starts + length - 1
    apart = np.diff(t) > (0.05 * (t[ends] - t[starts]) / np.maximum(length - 1, 1))[of[1:]]
    kept = np.append(apart, True) & np.append(True, apart)
    kept[starts] = kept[ends] = True
    t, y, of = t[kept], y[kept], of[kept]
    size = np.bincount(of, minlength=len(spans))
    starts = np.cumsum(size) - size
    place = np.arange(len(t)) - starts[of]
    inner = np.flatnonzero((place > 0) & (place < size[of] - 1))
    first, last = (place[inner] == 1)[:, None], (place[inner] == size[of[inner]] - 2)[:, None]
    y = np.hstack([y, -y])  # whose highest points are the lowest ones
    before, here, after = y[inner - 1], y[inner], y[inner + 1]
    tops = (here >= before) & (here >= after) | first & (before > here) | last & (after > here)
    row, column = np.nonzero(tops)
    at, found = inner[row], np.hstack([high, -low])
    points = np.minimum(POINTS, size[of[at]])
    for count in np.unique(points):  # one, but for spans of few samples
        near, signal = at[points == count], column[points == count]
        span = of[near]
        nodes = (starts[span] + np.clip(place[near] - count // 2, 0, size[span] - count))[:, None] + np.arange(count)
        np.maximum.at(found, (span, signal), _find_peaks(t[nodes], y[nodes, signal[:, None]]))
    return found[:, : high.shape[1]], -found[:, high.shape[1] :]


def _find_peaks(t: Array, z: Array) -> Array:
    """Maximum of each polynomial through its points near the highest of them; shapes (P, m), (P, m) → (P,)."""
    every, count = np.arange(len(t)), t.shape[1]
    s = (t - t[:, :1]) / ((t[:, -1:] - t[:, :1]) / 2) - 1
    top = z.argmax(axis=1)
    low, at, high = s[every, np.maximum(top - 1, 0)], s[every, top], s[every, np.minimum(top + 1, count - 1)]
    # Newton's divided differences, then the coefficients of the powers (Björck and Pereyra)
    c = z.copy()
    for k in range(count - 1):
        c[:, k + 1 :] = (c[:, k + 1 :] - c[:, k:-1]) / (s[:, k + 1 :] - s[:, : count - k - 1])
    for k in range(count - 2, -1, -1):
        c[:, k:-1] -= c[:, k + 1 :] * s[:, k : k + 1]
    value = z[every, top]
    for _ in range(9):
        value, slope, bend = np.zeros((3, len(t)))
        for i in range(count - 1, -1, -1):
            bend = bend * at + 2 * slope
            slope = slope * at + value
            value = value * at + c[:, i]
        before, at = at, np.clip(at - np.divide(slope, bend, out=np.zeros_like(bend), where=bend < 0), low, high)
        if np.array_equal(before, at):
            break
    return np.maximum(value, z[every, top])


class ExtremesTracker:
    """Largest and smallest output of each open-loop interval, from the outputs at every step.

    Chunks of steps are added as they come; of many only the steps of the interval under way are kept.
    """

    def __init__(self, t: float, y: Array, jumps: Jumps | None = None) -> None:
        """Start at ``t`` with outputs ``y`` (n_y,).

        ``jumps`` gives the times between two others at which accelerations may jump.
        """
        self._jumps = jumps or (lambda start, end: np.zeros(0))
        self._t, self._y, self._ends, self._count = [np.array([t])], [np.array([y])], [np.zeros(0, int)], 1
        self._max, self._min = [self._y[0][:0]], [self._y[0][:0]]

    def add(self, t: Array, y: Array, event_at: np.ndarray) -> None:
        """Add steps at ``t`` (M,) with outputs ``y`` (M, n_y), of which those at ``event_at`` end an interval."""
        self._t.append(t.copy())
        self._y.append(y)
        self._ends.append(np.asarray(event_at, dtype=int) + self._count)
        self._count += len(t)
        if self._count > MANY and len(event_at):
            self._settle()

    def _settle(self) -> None:
        """Find the extremes of all intervals that are complete, and leave out their steps."""
        t, y = np.concatenate(self._t), np.concatenate(self._y)
        start, spans, firsts = 0, list[tuple[int, int]](), list[int]()
        for end in np.concatenate(self._ends):
            inside = self._jumps(float(t[start]), float(t[end]))
            # a jump at either end cuts nothing, whatever the last bit of its time is
            inside = inside[(inside - t[start] > ONE_INSTANT) & (t[end] - inside > ONE_INSTANT)]
            cuts = start + np.searchsorted(t[start : end + 1], inside - ONE_INSTANT)
            firsts.append(len(spans))
            spans += pairwise([start, *cuts, end])
            start = end
        if spans:
            high, low = find_extremes(t, y, np.array(spans))
            self._max.append(np.maximum.reduceat(high, firsts))
            self._min.append(np.minimum.reduceat(low, firsts))
        self._t, self._y, self._ends, self._count = [t[start:]], [y[start:]], [np.zeros(0, int)], len(t) - start

    def result(self) -> tuple[Array, Array]:
        """(y_max, y_min) of the completed intervals, shapes (K, n_y)."""
        self._settle()
        return np.concatenate(self._max), np.concatenate(self._min)
