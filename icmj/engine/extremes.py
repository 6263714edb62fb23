"""Extremes of the outputs between events, to better than the integrator's order."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array

POINTS = 6  # a quintic: its sixth-order error stays below that of the fourth-order integrator
POINTS_ADAPTIVE = 8  # of the samples within adaptive steps, whose dense output is of order 7

Jumps = Callable[[float, float], Array]
Find = Callable[[Array, Array, int], tuple[Array, Array]]


class ExtremesTracker:
    """Largest and smallest output of each open-loop interval, from the outputs at every step.

    Chunks of steps are added as they come; only the steps of the interval under way are kept.
    """

    def __init__(
        self, t: float, y: Array, jumps: Jumps | None = None, find: Find | None = None, points: int = POINTS
    ) -> None:
        """Start at ``t`` with outputs ``y`` (n_y,).

        ``jumps`` gives the times between two others at which accelerations may jump; ``find`` is :func:`extremes` or
        another that does the same faster, with polynomials through so many ``points``.
        """
        self._jumps = jumps or (lambda start, end: np.zeros(0))
        self._find, self._points = find or extremes, points
        self._t = np.array([t])
        self._y = np.array([y])
        self._max: list[Array] = []
        self._min: list[Array] = []

    def add(self, t: Array, y: Array, event_at: np.ndarray) -> None:
        """Add steps at ``t`` (M,) with outputs ``y`` (M, n_y), of which those at ``event_at`` end an interval."""
        at = np.asarray(event_at, dtype=int) + len(self._t)
        self._t = np.concatenate([self._t, t])
        self._y = np.concatenate([self._y, y])
        start = 0
        for end in at:
            t_i, y_i = self._t[start : end + 1], self._y[start : end + 1]
            inside = self._jumps(float(t_i[0]), float(t_i[-1]))
            cuts = [0, *np.searchsorted(t_i, inside), len(t_i) - 1]
            parts = [self._find(t_i[a : b + 1], y_i[a : b + 1], self._points) for a, b in pairwise(cuts)]
            self._max.append(np.max([high for high, _ in parts], axis=0))
            self._min.append(np.min([low for _, low in parts], axis=0))
            start = end
        self._t, self._y = self._t[start:], self._y[start:]

    def result(self) -> tuple[Array, Array]:
        """(y_max, y_min) of the completed intervals, shapes (K, n_y)."""
        shape = (len(self._max), self._y.shape[1])
        return np.array(self._max).reshape(shape), np.array(self._min).reshape(shape)


def extremes(t: Array, y: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Largest and smallest value of each smooth signal y(t), between samples too.

    Around every sample that is higher (lower) than its neighbours the polynomial through the ``points`` nearest
    samples is maximised; the ends of the span count as they are. Samples much closer together than the others are
    thinned, for a polynomial through them would magnify rounding. Shapes (M,), (M, n) → (n,), (n,).
    """
    high, low = y.max(axis=0), y.min(axis=0)
    gap = np.diff(t)
    keep = np.ones(len(t), dtype=bool)
    if len(t) > 2:
        keep[1:-1] = np.minimum(gap[:-1], gap[1:]) > 0.05 * (t[-1] - t[0]) / len(gap)
    t, y = t[keep], y[keep]
    if len(t) < 3:
        return high, low
    size = min(points, len(t))
    for sign, best in ((1.0, high), (-1.0, low)):
        z = sign * y
        peak = (z[1:-1] >= z[:-2]) & (z[1:-1] >= z[2:])
        # a peak can hide in the first or last step, too: there the sample at the end is the highest
        peak[0] |= z[0] > z[1]
        peak[-1] |= z[-1] > z[-2]
        row, column = np.nonzero(peak)
        if len(row) == 0:
            continue
        first = np.clip(row + 1 - size // 2, 0, len(t) - size)
        index = first[:, None] + np.arange(size)
        value = _peak(t[index], z[index, column[:, None]])
        np.maximum.at(best, column, value) if sign > 0 else np.minimum.at(best, column, -value)
    return high, low


def _peak(t: Array, z: Array) -> Array:
    """Maximum of the polynomial through each row's points, near its highest point; shapes (K, P) → (K,)."""
    scale = (t[:, -1] - t[:, 0]) / 2
    s = (t - t[:, :1]) / scale[:, None] - 1
    coefficients = np.linalg.solve(s[..., None] ** np.arange(t.shape[1]), z[..., None])[..., 0]
    top = z.argmax(axis=1)
    rows = np.arange(len(t))
    left, right = s[rows, np.maximum(top - 1, 0)], s[rows, np.minimum(top + 1, t.shape[1] - 1)]
    power = np.arange(1, t.shape[1])
    slope = coefficients[:, 1:] * power
    bend = slope[:, 1:] * power[:-1]
    at = s[rows, top]
    for _ in range(8):
        d1, d2 = _evaluate(slope, at), _evaluate(bend, at)
        step = np.where(d2 < 0, -d1 / np.where(d2 < 0, d2, -1.0), 0.0)
        at = np.clip(at + step, left, right)
    return np.maximum(_evaluate(coefficients, at), z.max(axis=1))


def _evaluate(coefficients: NDArray[np.floating[Any]], s: Array) -> Array:
    value = np.zeros_like(s)
    for c in coefficients.T[::-1]:
        value = value * s + c
    return value
