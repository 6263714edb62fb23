"""Polynomials on [0, 1] in Bernstein form: certified bounds, first roots and extremes.

A polynomial lies in the convex hull of its Bernstein coefficients, so these bound it without sampling it; halving
the interval makes the bound converge quadratically. Points of R^r work alike: the norm of a polynomial curve is at
most the largest norm of its control points. That is how a whole integration step is decided at once.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from icmj.base.array import Array

# Halving [0, 1] this often leaves intervals of 2e-16: what is undecided there touches zero to round-off.
_DEPTH = 52


@lru_cache(maxsize=64)
def from_powers(degree: int) -> Array:
    """Matrix from power coefficients a_j (of θ^j) to Bernstein coefficients, shape (degree + 1, degree + 1).

    All entries lie in [0, 1], so the conversion in this direction loses no accuracy.
    """
    return np.array([[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)])


@lru_cache(maxsize=64)
def halves(degree: int) -> tuple[Array, Array]:
    """De Casteljau's matrices from the coefficients on [0, 1] to those on [0, ½] and [½, 1]."""
    left = np.array([[comb(i, j) / 2.0**i for j in range(degree + 1)] for i in range(degree + 1)])
    return left, left[::-1, ::-1].copy()


@lru_cache(maxsize=256)
def beginning(degree: int, end: float) -> Array:
    """De Casteljau's matrix from the coefficients on [0, 1] to those on [0, end]."""
    i, j = np.arange(degree + 1)[:, None], np.arange(degree + 1)
    return _binomials(degree) * end**j * (1 - end) ** np.maximum(i - j, 0)


@lru_cache(maxsize=64)
def _binomials(degree: int) -> Array:
    return np.array([[comb(i, j) for j in range(degree + 1)] for i in range(degree + 1)], dtype=float)


def evaluate(powers: Array, theta: float) -> float:
    """Σ a_j θ^j by Horner's rule."""
    value = 0.0
    for a in powers[::-1].tolist():
        value = value * theta + a
    return value


def first_root(powers: Array) -> float | None:
    """Smallest θ in [0, 1] where the polynomial Σ a_j θ^j is not negative, or ``None`` if it is negative throughout.

    No root is missed however close two of them lie: an interval is dismissed only if all its Bernstein coefficients
    are negative, and accepted only if it shows exactly one sign change (then it holds exactly one root, by
    Descartes' rule); all others are halved. An undecided interval of 2e-16 touches zero to round-off, about 1e-15 of
    the largest coefficient, and counts as a root.
    """
    powers = np.asarray(powers, dtype=float)
    degree = len(powers) - 1
    left, right = halves(degree)
    pending = [(from_powers(degree) @ powers, 0.0, 1.0, 0)]
    while pending:
        b, start, end, depth = pending.pop()
        if b[0] >= 0:
            return start
        if b.max() < 0:
            continue
        if b[-1] > 0 and np.count_nonzero(np.diff(b > 0)) == 1:
            return _bracketed(powers, start, end)
        if depth >= _DEPTH:
            return start
        middle = (start + end) / 2
        pending.append((right @ b, middle, end, depth + 1))
        pending.append((left @ b, start, middle, depth + 1))
    return None


def _bracketed(powers: Array, start: float, end: float) -> float:
    """The root between a negative value and a positive one, to round-off: Newton's steps, halves where these are slow.

    SciPy's ``brentq`` finds the same, after an import that takes longer than a whole run.
    """
    if evaluate(powers, start) >= 0:
        return start
    if evaluate(powers, end) <= 0:
        return end
    slopes = powers[1:] * np.arange(1, len(powers))
    theta, step = (start + end) / 2, end - start
    while True:
        value, slope = evaluate(powers, theta), evaluate(slopes, theta)
        if value < 0:
            start = theta
        else:
            end = theta
        last, step = step, value / slope if slope > 0 else np.inf
        if not start < theta - step < end or abs(2 * step) > abs(last):
            step = theta - (start + end) / 2
        if value == 0 or abs(step) <= 1e-16 or theta - step == theta:
            return theta - (step if value else 0.0)
        theta -= step


def largest(powers: Array, end: float = 1.0) -> float:
    """Largest value of the polynomial Σ a_j θ^j on [0, end].

    An interval counts only if its Bernstein coefficients exceed what is known; it holds one maximum inside if these
    first rise, then fall, and none if they fall, then rise, or do neither; all others are halved.
    """
    powers = np.asarray(powers, dtype=float)
    degree = len(powers) - 1
    reached = max(evaluate(powers, 0.0), evaluate(powers, end))
    left, right = halves(degree)
    falls = -powers[1:] * np.arange(1, degree + 1)
    pending = [(from_powers(degree) @ (powers * end ** np.arange(degree + 1)), 0.0, end, 0)]
    while pending:
        b, start, stop, depth = pending.pop()
        if not b.max() > reached + 1e-15 * abs(reached):
            continue
        rises = np.diff(b) > 0
        changes = np.count_nonzero(rises[1:] != rises[:-1])
        if depth >= _DEPTH or changes == 0 or (changes == 1 and not rises[0]):
            reached = max(reached, evaluate(powers, start), evaluate(powers, stop))
        elif changes == 1:
            reached = max(reached, evaluate(powers, _bracketed(falls, start, stop)))
        else:
            middle = (start + stop) / 2
            pending.append((right @ b, middle, stop, depth + 1))
            pending.append((left @ b, start, middle, depth + 1))
    return reached
