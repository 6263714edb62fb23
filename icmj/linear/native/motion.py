"""The motion between events in compiled code: matrices times the state, and the state anywhere on the way."""

from __future__ import annotations

import numpy as np

from icmj.base.compilation import compiled, summing


@summing
def times(T, s, out):  # type: ignore[no-untyped-def]
    """``out`` := T s, with as many rows and columns of T as they are long."""
    for i in range(len(out)):
        total = 0.0
        for j in range(len(s)):
            total += T[i, j] * s[j]
        out[i] = total


@summing
def combine(columns, s, out):  # type: ignore[no-untyped-def]
    """``out`` := Σ s_j columns_j, for few of them, and long: quicker than their matrix row by row."""
    for i in range(len(out)):
        out[i] = 0.0
    for j in range(len(columns)):
        a, column = s[j], columns[j]
        for i in range(len(out)):
            out[i] += a * column[i]


@summing
def dot(row, s):  # type: ignore[no-untyped-def]
    """The product of two vectors, as long as the second."""
    total = 0.0
    for j in range(len(s)):
        total += row[j] * s[j]
    return total


@compiled
def close(place):  # type: ignore[no-untyped-def]
    """How far from a place in steps another is the same but for rounding."""
    return 1e-13 + 4e-16 * place


@compiled
def copy(source, to):  # type: ignore[no-untyped-def]
    """As long as ``to`` is."""
    for i in range(len(to)):
        to[i] = source[i]


@compiled
def add(source, to):  # type: ignore[no-untyped-def]
    """As long as ``source`` is."""
    for i in range(len(source)):
        to[i] += source[i]


@compiled
def move(f, by, signals):  # type: ignore[no-untyped-def]
    """Taylor coefficients of polynomials about a place ``by`` steps further on, in place (Horner's scheme)."""
    powers = len(f) // signals if signals > 0 else 0
    for k in range(powers - 1):
        for j in range(powers - 2, k - 1, -1):
            for i in range(signals):
                f[j * signals + i] += by * f[(j + 1) * signals + i]


@compiled
def unfold(T, s, m, theta, series):  # type: ignore[no-untyped-def]
    """``series`` := Taylor coefficients of (z, f) on the step from ``s``, as many as it takes until ``theta``.

    f of ``s`` is about the step's middle.

    Returns:
        how many there are.
    """
    count, signals = T.terms[int(np.ceil(theta * (len(T.terms) - 1)))], T.M.shape[1] - m
    powers = (len(s) - m) // signals if signals > 0 else 0
    copy(s, series[0, :m])
    for j in range(max(powers, count)):
        for k in range(signals):
            series[j, m + k] = s[m + j * signals + k] if j < powers else 0.0
    for k in range(powers - 1):  # from the middle to the beginning
        for j in range(powers - 2, k - 1, -1):
            for i in range(m, m + signals):
                series[j, i] -= 0.5 * series[j + 1, i]
    # z_{j+1} = (h M z_j + h D f_j)/(j + 1)
    for j in range(count):
        times(T.M, series[j], series[j + 1, :m])
        for i in range(m):
            series[j + 1, i] /= j + 1
    return count + 1


@summing
def at(series, count, theta, result):  # type: ignore[no-untyped-def]
    """``result`` := the sum of ``count`` terms of ``series`` at ``theta``."""
    copy(series[count - 1], result)
    for j in range(count - 2, -1, -1):
        for i in range(len(result)):
            result[i] = result[i] * theta + series[j, i]
