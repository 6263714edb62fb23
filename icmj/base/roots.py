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
_SHORT = 8  # degree of a derivative's part that is looked at first
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


@summing
def _bend(powers, degree, theta):  # type: ignore[no-untyped-def]
    """First and second derivative, odd and even powers each on their own: neither sum waits for the other."""
    square, top = theta * theta, degree - degree % 2
    slopes, slopes_odd = 0.0, 0.0
    bends, bends_odd = 0.0, 0.0
    if top < degree:
        slopes = degree * powers[degree]
        bends_odd = (degree - 1) * slopes
    for j in range(top, 1, -2):
        even, odd = j * powers[j], (j - 1) * powers[j - 1]
        slopes_odd = slopes_odd * square + even
        bends = bends * square + (j - 1) * even
        slopes = slopes * square + odd
        if j > 2:
            bends_odd = bends_odd * square + (j - 2) * odd
    return slopes + theta * slopes_odd, bends + theta * bends_odd


@compiled
def _find_bracketed(powers, degree, start, end):  # type: ignore[no-untyped-def]
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
def _turn(powers, degree, sign, start, end, theta):  # type: ignore[no-untyped-def]
    """Where the slope of sign · polynomial falls through zero between ``start`` and ``end``, from ``theta`` on."""
    step = end - start
    while True:
        value, rate = _bend(powers, degree, theta)
        value, rate = -sign * value, -sign * rate
        if value < 0:
            start = theta
        else:
            end = theta
        last, step, enough = step, value / rate if rate > 0 else np.inf, 1e-8
        if not start < theta - step < end or abs(2 * step) > abs(last):
            step, enough = theta - (start + end) / 2, 1e-12
        # the error of Newton's place is the square of its step, and counts squared in the value
        if abs(step) <= enough:
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
def _bernstein(b, degree):  # type: ignore[no-untyped-def]
    """Powers to Bernstein coefficients of so low a degree, in place."""
    choices = 1.0
    for j in range(degree + 1):
        b[j] /= choices
        choices = choices * (degree - j) / (j + 1)
    for k in range(1, degree + 1):
        for j in range(degree, k - 1, -1):
            b[j] += b[j - 1]


@compiled
def _rises(powers, degree, b):  # type: ignore[no-untyped-def]
    """Whether the first few terms of the slope, with a bound of the others, tell that it is positive on [0, 1]."""
    short, rest = min(degree - 1, _SHORT), 0.0
    for j in range(short + 1):
        b[j] = (j + 1) * powers[j + 1]
    for j in range(short + 1, degree):
        rest += (j + 1) * abs(powers[j + 1])
    if not short >= 0:
        return False
    _bernstein(b, short)
    least = b[0]
    for j in range(1, short + 1):
        least = min(least, b[j])
    return least > rest


@compiled
def first_root(powers, degree, F, stack, spans, at=0.0):  # type: ignore[no-untyped-def]
    """Smallest θ in [at, 1] where the polynomial is not negative; infinity if it is negative throughout."""
    if _rises(powers, degree, stack[2]):
        if evaluate(powers, degree, 1.0) < 0:
            return np.inf
        return _find_bracketed(powers, degree, at, 1.0)
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
            return _find_bracketed(powers, degree, start, end)
        if depth >= _HALVINGS or not np.isfinite(most):
            return start
        _split(stack[top + 1], b, degree, 0.5)
        middle = (start + end) / 2
        spans[top, 0], spans[top, 1], spans[top, 2] = middle, end, depth + 1
        spans[top + 1, 0], spans[top + 1, 1], spans[top + 1, 2] = start, middle, depth + 1
        top += 2
    return np.inf


@compiled
def largest(powers, degree, sign, until, reached, F, stack, spans, since=0.0):  # type: ignore[no-untyped-def]
    """The larger of ``reached`` and of sign · polynomial on [since, until].

    An interval counts only if its Bernstein coefficients exceed what is known; it holds one maximum inside if these
    first rise, then fall, and none if they fall, then rise, or do neither; all others are halved.
    """
    scale = sign
    for j in range(degree + 1):
        stack[1, j] = scale * powers[j]
        scale *= until
    to_bernstein(stack[1], degree, F, stack[0])
    if since > 0:
        _split(stack[1], stack[0], degree, since / until)
    spans[0, 0], spans[0, 1], spans[0, 2] = since, until, 0.0
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
            theta = _turn(powers, degree, sign, start, end, (start + end) / 2)
            reached = max(reached, sign * evaluate(powers, degree, theta))
            continue
        _split(stack[top + 1], b, degree, 0.5)
        middle = (start + end) / 2
        spans[top, 0], spans[top, 1], spans[top, 2] = middle, end, depth + 1
        spans[top + 1, 0], spans[top + 1, 1], spans[top + 1, 2] = start, middle, depth + 1
        top += 2
    return reached


@compiled
def extend(powers, degree, until, high, low, F, stack, spans, since=0.0):  # type: ignore[no-untyped-def]
    """``high`` and ``low``, extended to the polynomial on [since, until].

    Where the second derivative has one sign, there is one extreme inside at most. Few of its Bernstein coefficients,
    with a bound of the terms that they leave out, tell this for most polynomials at a fraction of the cost.
    """
    short, b, scale, rest = min(degree - 2, _SHORT), stack[2], 1.0, 0.0
    for j in range(degree - 1):
        term = (j + 2) * (j + 1) * scale * powers[j + 2]
        scale *= until
        if j <= short:
            b[j] = term
        else:
            rest += abs(term)
    _bernstein(b, short)
    most, least = -np.inf, np.inf
    for j in range(short + 1):
        most, least = max(most, b[j]), min(least, b[j])
    if not (most < -rest or least > rest):
        high = largest(powers, degree, 1.0, until, high, F, stack, spans, since)
        return high, -largest(powers, degree, -1.0, until, -low, F, stack, spans, since)
    first, last, begin = powers[0], evaluate(powers, degree, until), powers[1]
    if since > 0:
        first, begin = evaluate(powers, degree, since), slope(powers, degree, since)
    high, low = max(high, first, last), min(low, first, last)
    end = slope(powers, degree, until)
    if begin > 0 > end or begin < 0 < end:
        guess = since + (until - since) * begin / (begin - end)
        turn = evaluate(powers, degree, _turn(powers, degree, np.sign(begin), since, until, guess))
        high, low = max(high, turn), min(low, turn)
    return high, low
