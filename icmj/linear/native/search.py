"""What ends a step, and how far the outputs go on it, decided by certified bounds instead of samples.

A curve R_j e(θ) stays within the largest norm of its control points, so a step whose control points are all inside
every face of the event rule holds no event; only on the others the polynomial E_j itself is looked at for its first
root. Most steps are dismissed before, by short polynomials, of which the rest of their series is bounded.
"""

from __future__ import annotations

import numpy as np

from icmj.base.compilation import compiled, inlined
from icmj.base.roots import extended, first_root, to_bernstein
from icmj.linear.native.motion import add_square, dot, times

_LARGE, _TINY, _NORMAL = 1e8, 1e-290, 2.3e-308
NOTHING, EVENT, FALL = 0, 1, 2  # what ends a step


@compiled
def first_end(A, F, F2, cuts, n_pos, s, armed, falls, since, ready, work):  # type: ignore[no-untyped-def]
    """(kind, θ) of the first end on the step from ``s``: by the bounds of the whole series, then by roots.

    A fall counts from ``since`` on, an event from ``ready`` on.
    """
    curves, level, stack, spans = work.curves, work.level, work.stack, work.spans
    r = cuts[-1]
    degree = A.shape[1] - 1
    kind, first = NOTHING, np.inf
    if falls:
        for row in range(r, r + n_pos):
            times(A[row], s, curves[row])
            for sign in (1.0, -1.0):
                for j in range(degree + 1):
                    level[j] = sign * curves[row, j]
                level[0] -= 1
                theta = first_root(level, degree, F, stack, spans, since)
                if theta <= 1 and theta < first:
                    kind, first = FALL, theta
    if armed:
        for face in range(len(cuts) - 1):
            for i in range(degree + 1):
                level[i] = 0
            for row in range(cuts[face], cuts[face + 1]):
                times(A[row], s, curves[row])
                to_bernstein(curves[row], degree, F, stack[0])
                for i in range(degree + 1):
                    level[i] += stack[0, i] ** 2
            most = 0.0
            for i in range(degree + 1):
                most = max(most, level[i])
            if most < 1 - 1e-12:
                continue
            for i in range(2 * degree + 1):
                level[i] = 0
            for row in range(cuts[face], cuts[face + 1]):
                add_square(curves[row], level)
            level[0] -= 1
            theta = first_root(level, 2 * degree, F2, stack, spans, ready)
            if theta <= 1 and theta < first:
                kind, first = EVENT, theta
    return kind, first


@compiled
def extremes(A, F, row, s, since, theta, high, low, k, work):  # type: ignore[no-untyped-def]
    """Extend ``high`` and ``low`` of output ``k`` to the curve of ``row`` on [since, theta] of the step from ``s``."""
    curve = work.curves[row]
    times(A[row], s, curve)
    high[k], low[k] = extended(curve, len(curve) - 1, theta, high[k], low[k], F, work.stack, work.spans, since)


@inlined
def extend(T, run, z, first):  # type: ignore[no-untyped-def]
    """Extend the extremes to the outputs at ``z``, or begin them there."""
    for k in range(len(run.high)):
        y = dot(T.C[k], z)
        if first:
            run.high[k] = run.low[k] = y
        else:
            run.high[k], run.low[k] = max(run.high[k], y), min(run.low[k], y)


@inlined
def doubtful(T, m, s, out, tails, armed, begun, high, low, turning):  # type: ignore[no-untyped-def]
    """What the short polynomials cannot exclude on the step from ``s``, of which ``out`` is W s and ``tails`` V |s|.

    Of the faces these are there where the event rule is ``armed``. Where the piece had ``begun`` before the step, the
    outputs where the step begins are on the way, too.

    Returns:
        whether it grows large; whether an event, a fall, an extreme of any output are to be looked for.
    """
    n_y, cuts, coarse = len(high), T.cuts, T.coarse
    n_pos = len(T.V) - n_y - cuts[-1]
    at = m + n_pos + n_y * (coarse + 1)  # of the faces
    biggest = 0.0
    for k in range(m):
        biggest = max(biggest, abs(s[k]), abs(out[k]))
    wild = not biggest < _LARGE
    watched, falls, turns = armed and wild, wild, wild
    if armed:
        for face in range(len(cuts) - 1):
            most, tail = 0.0, 0.0
            for row in range(cuts[face], cuts[face + 1]):
                tail += tails[n_pos + n_y + row] ** 2
            for k in range(coarse + 1):
                square = 0.0
                for row in range(cuts[face], cuts[face + 1]):
                    square += out[at + row * (coarse + 1) + k] ** 2
                most = max(most, square)
            if not np.sqrt(most) + np.sqrt(tail) < 1 - 1e-12:
                watched = True
    at = m + n_pos
    for k in range(n_y):
        if begun:
            high[k], low[k] = max(high[k], out[at]), min(low[k], out[at])
        rise, fall, most, least = np.inf, -np.inf, out[at], out[at]
        for j in range(coarse):
            change = out[at + j + 1] - out[at + j]
            rise, fall = min(rise, change), max(fall, change)
            most, least = max(most, out[at + j + 1]), min(least, out[at + j + 1])
        tail = tails[n_pos + k]  # of the slope, hence more than of the value
        turns_not = coarse * rise - tail >= 0 or coarse * fall + tail <= 0
        turning[k] = wild or not (turns_not or (most + tail <= high[k] and least - tail >= low[k]))
        turns = turns or turning[k]
        at += coarse + 1
    for k in range(n_pos):
        if not abs(out[m + k]) + tails[k] < 1 - 1e-12:
            falls = True
    return wild, watched, falls, turns


@compiled
def settle(s, sizes):  # type: ignore[no-untyped-def]
    """``sizes`` := |s|, as far as that goes; what is subnormal becomes zero, and all where all is next to nothing."""
    biggest = 0.0
    for k in range(len(sizes)):
        sizes[k] = abs(s[k])
        if sizes[k] < _NORMAL:  # rounding would keep the smallest subnormal alive for ever
            s[k] = 0
        biggest = max(biggest, sizes[k])
    if biggest < _TINY:  # zero for every purpose; subnormal numbers would only be slow
        for k in range(len(sizes)):
            s[k] = sizes[k] = 0
