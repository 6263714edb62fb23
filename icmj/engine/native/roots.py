"""The first root of a polynomial on an interval; what :func:`icmj.base.bernstein.first_root` does, compiled."""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers
from icmj.engine.native.compilation import compiled, exact
from icmj.engine.native.memory import bare
from icmj.engine.tableau import POWER

DEGREE, DEPTH = 2 * POWER, 52
_SIZE, _DEPTH, _POWER = DEGREE + 1, DEPTH, POWER


class Roots(NamedTuple):
    """Room to look for the event function's first root in.

    Attributes:
        to_bernstein: from power to Bernstein coefficients, shape (15, 15).
        row, powers: coefficients of a row of R a(θ), (8,), and of E, (15,).
        pending: Bernstein coefficients of the intervals still to be looked at, shape (54, 15).
        spans: their ends and how often they were halved, shape (54, 3).
    """

    to_bernstein: Array
    row: Array
    powers: Array
    pending: Array
    spans: Array


def roots() -> Roots:
    """Room for one loop."""
    assert comb(DEGREE, 1) == DEGREE
    return Roots(
        np.ascontiguousarray(from_powers(DEGREE)), np.zeros(POWER + 1), np.zeros(DEGREE + 1),
        np.zeros((DEPTH + 2, DEGREE + 1)), np.zeros((DEPTH + 2, 3)),
    )  # fmt: skip


@exact
def bare_roots(r):  # type: ignore[no-untyped-def]
    """The arrays without a reference count."""
    return Roots(bare(r.to_bernstein), bare(r.row), bare(r.powers), bare(r.pending), bare(r.spans))


@compiled
def level(powers, theta):  # type: ignore[no-untyped-def]
    """Σ a_j θ^j and its derivative."""
    value, slope = 0.0, 0.0
    for j in range(_SIZE - 1, -1, -1):
        slope = slope * theta + value
        value = value * theta + powers[j]
    return value, slope


@compiled
def _split(b, at, right):  # type: ignore[no-untyped-def]
    """Coefficients on [0, at] left in ``b``, those on [at, 1] into ``right``."""
    n = _SIZE - 1
    right[n] = b[n]
    for k in range(1, n + 1):
        for i in range(n, k - 1, -1):
            b[i] = (1 - at) * b[i - 1] + at * b[i]
        right[n - k] = b[n]


@compiled
def _bracketed(powers, start, end):  # type: ignore[no-untyped-def]
    if level(powers, start)[0] >= 0:
        return start
    if level(powers, end)[0] <= 0:
        return end
    theta, step = (start + end) / 2, end - start
    for _ in range(200):
        value, slope = level(powers, theta)
        if value < 0:
            start = theta
        else:
            end = theta
        last, step = step, value / slope if slope > 0 else np.inf
        if not start < theta - step < end or abs(2 * step) > abs(last):
            step = theta - (start + end) / 2
        if value == 0 or abs(step) <= 1e-16 or theta - step == theta:
            return theta - (step if value != 0 else 0.0)
        theta -= step
    return theta


@compiled
def first_root(r, at):  # type: ignore[no-untyped-def]
    """Smallest θ in [at, 1] where the polynomial ``r.powers`` is not negative; infinity if there is none."""
    b = r.pending[0]
    for i in range(_SIZE):
        b[i] = 0.0
        for j in range(i + 1):
            b[i] += r.to_bernstein[i, j] * r.powers[j]
    r.spans[0, 0], r.spans[0, 1], r.spans[0, 2] = 0.0, 1.0, 0.0
    if at > 0:
        _split(b, at, r.pending[1])
        for i in range(_SIZE):
            b[i] = r.pending[1, i]
        r.spans[0, 0] = at
    count = 1
    while count > 0:
        count -= 1
        b = r.pending[count]
        start, end, depth = r.spans[count, 0], r.spans[count, 1], r.spans[count, 2]
        if b[0] >= 0:
            return start
        top, changes = b[0], 0
        for i in range(1, _SIZE):
            top = max(top, b[i])
            if (b[i] > 0) != (b[i - 1] > 0):
                changes += 1
        if top < 0:
            continue
        if b[_SIZE - 1] > 0 and changes == 1:
            return _bracketed(r.powers, start, end)
        if depth >= _DEPTH or not np.isfinite(top):
            return start
        middle = (start + end) / 2
        # the right half stays below, the left one comes above it and is looked at first
        _split(b, 0.5, r.pending[count + 1])
        for i in range(_SIZE):
            b[i], r.pending[count + 1, i] = r.pending[count + 1, i], b[i]
        r.spans[count, 0], r.spans[count, 1], r.spans[count, 2] = middle, end, depth + 1
        r.spans[count + 1, 0], r.spans[count + 1, 1], r.spans[count + 1, 2] = start, middle, depth + 1
        count += 2
    return np.inf


@compiled
def event_in(r, stepper, rule, first, at):  # type: ignore[no-untyped-def]
    """Where in the step, from the fraction ``at`` on, the event function first reaches zero; −1 if it had before.

    ``first`` is where the controller's states begin in the state. Infinity where it does not reach zero.
    """
    found = np.inf
    for face in range(len(rule.cuts) - 1):
        for j in range(_SIZE):
            r.powers[j] = 0.0
        r.powers[0] = -1.0
        for k in range(rule.cuts[face], rule.cuts[face + 1]):
            p = r.row
            for j in range(_POWER + 1):
                p[j] = 0.0
            for i in range(rule.spans[k, 0], rule.spans[k, 1]):
                p[0] += rule.R[k, i] * stepper.start[first + i]
            for m in range(_POWER):
                part = 0.0
                for i in range(rule.spans[k, 0], rule.spans[k, 1]):
                    part += rule.R[k, i] * stepper.F[m, first + i]
                for j in range(m + 2):
                    p[j] += part * stepper.powers[m, j]
            for i in range(_POWER + 1):
                for j in range(_POWER + 1):
                    r.powers[i + j] += p[i] * p[j]
        if at > 0 and level(r.powers, at)[0] >= 0:
            return -1.0
        if at < 1:
            found = min(found, first_root(r, at))
    return found
