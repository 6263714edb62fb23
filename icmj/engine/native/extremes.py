"""Extremes of smooth signals between their samples."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import call
from icmj.engine.native.memory import allocating, compiled, entry, sources


@compiled
def _peak(s, z, c):  # type: ignore[no-untyped-def]
    """Maximum near the highest point of the polynomial through (s, z); ``c`` is scratch of the same length."""
    size = len(s)
    top = 0
    for i in range(size):
        c[i] = z[i]
        if z[i] > z[top]:
            top = i
    # Newton's divided differences, then the coefficients of the powers (Björck and Pereyra)
    for k in range(size - 1):
        for i in range(size - 1, k, -1):
            c[i] = (c[i] - c[i - 1]) / (s[i] - s[i - k - 1])
    for k in range(size - 2, -1, -1):
        for i in range(k, size - 1):
            c[i] -= c[i + 1] * s[k]
    low, high = s[max(top - 1, 0)], s[min(top + 1, size - 1)]
    at, value = s[top], 0.0
    for _ in range(9):
        value, d1, d2 = 0.0, 0.0, 0.0
        for i in range(size - 1, -1, -1):
            d2 = d2 * at + 2 * d1
            d1 = d1 * at + value
            value = value * at + c[i]
        if d2 < 0:
            at = min(max(at - d1 / d2, low), high)
    return max(value, z[top])


@allocating
def _find(t, y, high, low, points):  # type: ignore[no-untyped-def]
    gap = 0.05 * (t[-1] - t[0]) / max(len(t) - 1, 1)
    kept = np.empty(len(t), np.int64)
    n = 0
    for i in range(len(t)):
        inside = 0 < i < len(t) - 1
        if not inside or min(t[i] - t[i - 1], t[i + 1] - t[i]) > gap:
            kept[n] = i
            n += 1
    size = min(points, n)
    s, z, c = np.empty(size), np.empty(size), np.empty(size)
    for column in range(y.shape[1]):
        top, bottom = -np.inf, np.inf
        for i in range(len(t)):
            top, bottom = max(top, y[i, column]), min(bottom, y[i, column])
        for i in range(1, n - 1):
            before, here, after = y[kept[i - 1], column], y[kept[i], column], y[kept[i + 1], column]
            for sign in (1.0, -1.0):
                peak = sign * here >= sign * before and sign * here >= sign * after
                peak = peak or (i == 1 and sign * before > sign * here)
                peak = peak or (i == n - 2 and sign * after > sign * here)
                if peak:
                    first = min(max(i - size // 2, 0), n - size)
                    begin, scale = t[kept[first]], (t[kept[first + size - 1]] - t[kept[first]]) / 2
                    for j in range(size):
                        s[j] = (t[kept[first + j]] - begin) / scale - 1
                        z[j] = sign * y[kept[first + j], column]
                    value = sign * _peak(s, z, c)
                    top, bottom = max(top, value), min(bottom, value)
        high[column], low[column] = top, bottom


@cache
def _entry() -> Any:
    source = sources()

    @entry
    def find(t, y, cuts, high, low, points):  # type: ignore[no-untyped-def]
        if source:
            top, bottom = np.empty(len(high)), np.empty(len(low))
            for k in range(len(cuts) - 1):
                _find(t[cuts[k] : cuts[k + 1] + 1], y[cuts[k] : cuts[k + 1] + 1], top, bottom, points)
                for i in range(len(high)):
                    high[i] = top[i] if k == 0 else max(high[i], top[i])
                    low[i] = bottom[i] if k == 0 else min(low[i], bottom[i])

    return find


def extremes(t: Array, y: Array, points: int, cuts: np.ndarray | None = None) -> tuple[Array, Array]:
    """Largest and smallest value of each signal y(t), between samples too, smooth but at the samples of ``cuts``.

    Around every sample that is higher (lower) than its neighbours the polynomial through the ``points`` nearest
    samples is maximised; the ends of the span count as they are. Samples much closer together than the others are
    thinned, for a polynomial through them would magnify rounding. Shapes (M,), (M, n) → (n,), (n,). The numbers in
    ``cuts`` rise from 0 to M − 1, which is what they are by default.
    """
    cuts = np.array([0, len(t) - 1]) if cuts is None else cuts
    high, low = np.empty(y.shape[1]), np.empty(y.shape[1])
    # contiguous: for every other layout numba would compile once more
    call(_entry(), np.ascontiguousarray(t), np.ascontiguousarray(y), cuts, high, low, points)
    return high, low
