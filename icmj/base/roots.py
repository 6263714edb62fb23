"""First roots and largest values of polynomials on [0, 1], certified, in compiled code.

A polynomial lies in the convex hull of its Bernstein coefficients (:mod:`icmj.base.bernstein`): an interval on which
all are negative holds no root, and one on which they change sign once holds exactly one, by Descartes' rule. All others
are halved, which makes the bound converge quadratically, so that no root is missed however close two of them lie.

Arguments that come again: ``powers`` are coefficients a_j of θ^j, the first ``degree`` + 1 of an array; ``F`` is
``from_powers(degree)``. Nothing is allocated: ``stack`` has :data:`DEEPEST` rows at least as long as the polynomial,
for Bernstein coefficients of pending intervals; ``spans`` has their starts, ends and depths, shape (DEEPEST, 3).
"""

from __future__ import annotations

import numpy as np

from icmj.base.compilation import compiled, summing

DEEPEST = 56  # rows that halving needs
_HALVINGS = 52  # leave intervals of 2e-16: what is undecided there touches zero to round-off, and counts as a root


@compiled
def evaluate(powers, degree, theta):  # type: ignore[no-untyped-def]
    """Σ a_j θ^j by Horner's rule."""
    value = powers[degree]
    for j in range(degree - 1, -1, -1):
        value = value * theta + powers[j]
    return value


@compiled
def slope(powers, degree, theta):  # type: ignore[no-untyped-def]
    """The derivative Σ j a_j θ^(j−1)."""
    value = degree * powers[degree]
    for j in range(degree - 1, 0, -1):
        value = value * theta + j * powers[j]
    return value


@compiled
def _curvature(powers, degree, theta):  # type: ignore[no-untyped-def]
    value = degree * (degree - 1) * powers[degree]
    for j in range(degree - 1, 1, -1):
        value = value * theta + j * (j - 1) * powers[j]
    return value


@compiled
def _bracketed(powers, degree, start, end):  # type: ignore[no-untyped-def]
    """The root between a negative value and a positive one: Newton's steps, halves where these are slow."""
    if evaluate(powers, degree, start) >= 0:
        return start
    if evaluate(powers, degree, end) <= 0:
        return end
    theta, step = (start + end) / 2, end - start
    while True:
        value, rate = evaluate(powers, degree, theta), slope(powers, degree, theta)
        if value < 0:
            start = theta
        else:
            end = theta
        last, step = step, value / rate if rate > 0 else np.inf
        if not start < theta - step < end or abs(2 * step) > abs(last):
            step = theta - (start + end) / 2
        if value == 0 or abs(step) <= 1e-16 or theta - step == theta:
            return theta if value == 0 else theta - step
        theta -= step


@compiled
def _turn(powers, degree, sign, start, end):  # type: ignore[no-untyped-def]
    """Where the slope of sign · polynomial falls through zero between ``start`` and ``end``, found in the same way."""
    theta, step = (start + end) / 2, end - start
    while True:
        value, rate = -sign * slope(powers, degree, theta), -sign * _curvature(powers, degree, theta)
        if value < 0:
            start = theta
        else:
            end = theta
        last, step = step, value / rate if rate > 0 else np.inf
        if not start < theta - step < end or abs(2 * step) > abs(last):
            step = theta - (start + end) / 2
        # an error of the place counts squared in the value
        if abs(step) <= 1e-12:
            return theta - step
        theta -= step


@summing
def to_bernstein(powers, degree, F, b):  # type: ignore[no-untyped-def]
    """Bernstein coefficients into ``b`` by the matrix ``F`` of this degree, which is lower triangular."""
    for i in range(degree + 1):
        total = 0.0
        for j in range(i + 1):
            total += F[i, j] * powers[j]
        b[i] = total


@compiled
def _split(left, right, degree, at):  # type: ignore[no-untyped-def]
    """De Casteljau: what ``right`` holds on [0, 1], on [0, at] into ``left`` and on [at, 1] into itself."""
    for k in range(degree + 1):
        left[k] = right[0]
        for i in range(degree - k):
            right[i] = (1 - at) * right[i] + at * right[i + 1]


@compiled
def first_root(powers, degree, F, stack, spans, at=0.0):  # type: ignore[no-untyped-def]
    """Smallest θ in [at, 1] where the polynomial is not negative; infinity if it is negative throughout."""
    to_bernstein(powers, degree, F, stack[0])
    if at > 0:
        _split(stack[1], stack[0], degree, at)
    spans[0, 0], spans[0, 1], spans[0, 2] = at, 1.0, 0.0
    top = 1
    while top > 0:
        top -= 1
        b, start, end, depth = stack[top], spans[top, 0], spans[top, 1], spans[top, 2]
        if b[0] >= 0:
            return start
        most, changes = b[0], 0
        for i in range(1, degree + 1):
            most = max(most, b[i])
            if (b[i] > 0) != (b[i - 1] > 0):
                changes += 1
        if most < 0:
            continue
        if b[degree] > 0 and changes == 1:
            return _bracketed(powers, degree, start, end)
        if depth >= _HALVINGS or not np.isfinite(most):
            return start
        _split(stack[top + 1], b, degree, 0.5)
        middle = (start + end) / 2
        spans[top, 0], spans[top, 1], spans[top, 2] = middle, end, depth + 1
        spans[top + 1, 0], spans[top + 1, 1], spans[top + 1, 2] = start, middle, depth + 1
        top += 2
    return np.inf


@compiled
def largest(powers, degree, sign, until, reached, F, stack, spans):  # type: ignore[no-untyped-def]
    """The larger of ``reached`` and of sign · polynomial on [0, until].

    An interval counts only if its Bernstein coefficients exceed what is known; it holds one maximum inside if these
    first rise, then fall, and none if they fall, then rise, or do neither; all others are halved.
    """
    scale = sign
    for j in range(degree + 1):
        stack[1, j] = scale * powers[j]
        scale *= until
    to_bernstein(stack[1], degree, F, stack[0])
    spans[0, 0], spans[0, 1], spans[0, 2] = 0.0, until, 0.0
    top = 1
    while top > 0:
        top -= 1
        b, start, end, depth = stack[top], spans[top, 0], spans[top, 1], spans[top, 2]
        most, ups, changes = b[0], b[1] > b[0], 0
        rises = ups
        for i in range(1, degree + 1):
            most = max(most, b[i])
            up = b[i] > b[i - 1]
            if up != ups:
                changes += 1
            ups = up
        if not most > reached + 1e-15 * abs(reached):
            continue
        if changes == 0 or (changes == 1 and not rises) or depth >= _HALVINGS:
            reached = max(reached, sign * evaluate(powers, degree, start), sign * evaluate(powers, degree, end))
            continue
        if changes == 1 and rises:
            theta = _turn(powers, degree, sign, start, end)
            reached = max(reached, sign * evaluate(powers, degree, theta))
            continue
        _split(stack[top + 1], b, degree, 0.5)
        middle = (start + end) / 2
        spans[top, 0], spans[top, 1], spans[top, 2] = middle, end, depth + 1
        spans[top + 1, 0], spans[top + 1, 1], spans[top + 1, 2] = start, middle, depth + 1
        top += 2
    return reached
