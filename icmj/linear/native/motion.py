"""The motion of the linear plant between events, in compiled code: matrices times the state.

Numbers that stay, numbers that change, and buffers. The state that it moves is s = (z, f): z the moving part of the
closed loop's state w (:mod:`icmj.controller.controller`), and f the derivatives of what acts on it from outside, in
steps, signal by signal within each power. A polynomial that acts on a linear system is part of a larger linear system
that nothing acts on, so one matrix of s does for quiet and disturbed motion alike; quiet motion has no f.

What ends a step, and how far the outputs go on it, is decided by certified bounds instead of samples.

A curve R_j e(θ) stays within the largest norm of its control points, so a step whose control points are all inside
every face of the event rule holds no event; only on the others the polynomial E_j itself is looked at for its first
root. Most steps are dismissed before, by short polynomials, of which the rest of their series is bounded.
"""

from __future__ import annotations

from enum import IntEnum, auto
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import compiled, fused, inlined, summing
from icmj.base.roots import extend as extended
from icmj.base.roots import first_root, to_bernstein


class Tables(NamedTuple):
    """What stays: m of z, l of s, S signals, p powers of f.

    Attributes:
        step: h [s].
        end: of the run [s].
        interval: between two recorded rows [s]; infinite if none are asked for.
        clock: its interval [s]; infinite if there is none.
        wait: from an event until the rule is watched again [s].
        sampling: from where the rule reaches its threshold to the event [s].
        delay: t_d [s].
        coarse: degree of the polynomials that bound a step.
        controls: how many control points they have.
        places, stride: of disturbed motion, how many instants of a step are a row's in one step or another, and how
            many of these from row to row; no places if the grid of rows does not fit that of the steps.
        powers: p.
        M: h ż from z and the signals, shape (m, m + S).
        C: the outputs, shape (n_y, m).
        Q: quiet motion, z a row on, shape (1, m, m); disturbed motion, z at each of the places, from that at the step's
            start, shape (places, m, m).
        R: what f adds at each of the places, shape (places, m, l − m).
        W: from s at a step's start, with f about its middle: z a step on, then the positions, then Bernstein
            coefficients of short polynomials for outputs and faces over the step; shape (…, l).
        W_z: what W makes of z, by columns, shape (m, …).
        V: bounds, from the sizes of s's entries, of how far positions move; and of what these polynomials leave out,
            of the slopes of outputs and the values of faces; shape (…, l).
        A: power coefficients of faces, positions and outputs over a step, shape (rows, N + 1, l).
        F, F2: from power to Bernstein coefficients of degree N and 2N.
        terms: how many terms of the series of z there are to be until an eighth of a step, two eighths, … a whole one.
        ahead, back: of disturbed motion, z at each eighth of a step, from s at its start with f about its middle; and z
            at its start, from z at each eighth and the same f; shapes (9, m, l).
        near: how many terms of the series of z there are to be until half an eighth.
        J, G: what an event and its action do to w.
        cuts: first row of each face of the event rule, and the number of rows.
        edges: when terms begin or end to act, rising, the last infinite [s].
        jumps: what impulses do to z at each of these, shape (…, m); (0, 0) without any.
        H: x_h from z, where S noises are shares of commands (:mod:`icmj.linear.loop`), shape (n̂, m).
        points: where the second and each further stretch of these begins, rising, the last infinite [s]; (0,) without.
        begins: where each stretch begins [s].
        lines: value and slope of each noise where a stretch begins, shape (stretches, S, 2); (0, 0, 2) without.
    """

    step: float
    end: float
    interval: float
    clock: float
    wait: float
    sampling: float
    delay: float
    coarse: int
    controls: int
    places: int
    stride: int
    powers: int
    M: Array
    C: Array
    Q: Array
    R: Array
    W: Array
    W_z: Array
    V: Array
    A: Array
    F: Array
    F2: Array
    terms: np.ndarray
    ahead: Array
    back: Array
    near: int
    J: Array
    G: Array
    cuts: np.ndarray
    edges: Array
    jumps: Array
    H: Array
    points: Array
    begins: Array
    lines: Array


class Acting(NamedTuple):
    """What acts on K steps of the grid, one after the other, as long as the same terms do.

    Attributes:
        first: number of the first of these steps.
        edge: when terms begin or end to act next [s].
        f: derivatives at the middle of each step, in steps, shape (lanes, l − m, K / lanes): every so manieth step is
            in the same lane.
        moved: what they add to z a step on, shape (lanes, K / lanes, m).
        rows: what they add to z at each of the places but the first, shape (lanes, K / lanes, …).
        controls: what they add to the control points in W s, shape (lanes, K / lanes, …).
        tails: a bound of what they add to V |s| on any step.
    """

    first: int
    edge: float
    f: Array
    moved: Array
    rows: Array
    controls: Array
    tails: Array


class Run(NamedTuple):
    """What changes, and room to work in.

    Attributes:
        now, counts: by :class:`Now` and :class:`Count`.
        when, due, queue: what the controller has planned, see :mod:`icmj.simulation.native.loop`.
        w: the loop's state; its first entries are z.
        s: (z, f) where a step begins, or a part of one, and f about the place half a step further on.
        begun, ended: z where the step begins that the last piece ended in, and where it ended.
        row: z of the last row of quiet motion.
        high, low: largest and smallest outputs since the last event.
        rows_t, rows_z, events: buffers; an event is its time, w just before, ``high`` and ``low``.
    """

    now: Array
    counts: np.ndarray
    when: Array
    due: np.ndarray
    queue: Array
    w: Array
    s: Array
    begun: Array
    ended: Array
    row: Array
    high: Array
    low: Array
    rows_t: Array
    rows_z: Array
    events: Array


class Now(IntEnum):
    """Times [s]."""

    TIME = 0
    ROW = auto()
    """When the last row was."""
    ORIGIN = auto()
    """From when on steps are counted in the piece under way."""
    BEGIN = auto()
    """When the piece under way begins."""
    STOP = auto()
    """When it ends."""
    OFFSET = auto()
    """Where the piece under way is in its step, in steps."""


class Count(IntEnum):
    """Counts and marks."""

    ROWS = 0
    """Written into the buffer."""
    EVENTS = auto()
    """Written into the buffer."""
    NEXT = auto()
    """Number of the next row of the grid."""
    AGE = auto()
    """Rows since the state of one was last taken from the steps'."""
    CELL = auto()
    """Number of the step that the piece under way is in; −1 where none is under way."""
    ENDED = auto()
    """Number of the step that the last piece ended in; −1 where that tells nothing of the next."""
    STRETCH = auto()
    """Number of the stretch of the noises that are shares of commands."""
    MET = auto()
    """What ended the last piece."""
    LEFT = auto()
    """Steps until the caller is asked."""


class Work(NamedTuple):
    """Scratch: curves of rows, the level of a face, pending intervals of a search and their coefficients."""

    curves: Array
    level: Array
    stack: Array
    spans: Array


FRESH = 1 << 30  # an age that makes the next row be taken from the steps


@summing
def times(T, s, out):  # type: ignore[no-untyped-def]
    """``out`` := T s, with as many rows and columns of T as they are long; four rows at once read s once for four."""
    fours = len(out) // 4 * 4
    for i in range(0, fours, 4):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(len(s)):
            a += T[i, j] * s[j]
            b += T[i + 1, j] * s[j]
            c += T[i + 2, j] * s[j]
            d += T[i + 3, j] * s[j]
        out[i], out[i + 1], out[i + 2], out[i + 3] = a, b, c, d
    for i in range(fours, len(out)):
        a = 0.0
        for j in range(len(s)):
            a += T[i, j] * s[j]
        out[i] = a


@summing
def combine(columns, s, out):  # type: ignore[no-untyped-def]
    """``out`` := Σ s_j columns_j, for few of them, and long: quicker than their matrix row by row."""
    for i in range(len(out)):
        out[i] = 0.0
    alone = len(columns) % 6
    for j in range(alone):
        a = s[j]
        for i in range(len(out)):
            out[i] += a * columns[j, i]
    for j in range(alone, len(columns), 6):
        a, b, c, d, e, f = s[j], s[j + 1], s[j + 2], s[j + 3], s[j + 4], s[j + 5]
        for i in range(len(out)):
            out[i] += (
                (a * columns[j, i] + b * columns[j + 1, i])
                + (c * columns[j + 2, i] + d * columns[j + 3, i])
                + (e * columns[j + 4, i] + f * columns[j + 5, i])
            )


@summing
def dot(row, s):  # type: ignore[no-untyped-def]
    """The product of two vectors, as long as the second."""
    total = 0.0
    for j in range(len(s)):
        total += row[j] * s[j]
    return total


@summing
def add_square(c, to):  # type: ignore[no-untyped-def]
    """``to`` += the square of the polynomial with coefficients ``c``, which is twice as long but one."""
    for i in range(len(c)):
        twice = 2 * c[i]
        to[2 * i] += c[i] * c[i]
        for j in range(i + 1, len(c)):
            to[i + j] += twice * c[j]


@summing
def add_times(factor, source, to):  # type: ignore[no-untyped-def]
    """``to`` += factor · source, as long as ``source`` is."""
    for i in range(len(source)):
        to[i] += factor * source[i]


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
def look_up(acting, cell, f):  # type: ignore[no-untyped-def]
    """``f`` := the derivatives at the middle of the step."""
    lanes = len(acting.f)
    lane, k = (cell - acting.first) % lanes, (cell - acting.first) // lanes
    for i in range(len(f)):
        f[i] = acting.f[lane, i, k]


@summing
def move(f, by, signals, out):  # type: ignore[no-untyped-def]
    """``out`` := derivatives of polynomials about a place ``by`` steps further on than those in ``f``."""
    copy(f, out)
    share = 1.0
    for k in range(1, len(f) // signals if signals > 0 else 0):
        share *= by / k
        add_times(share, f[k * signals :], out)


@compiled
def unfold(T, s, m, theta, series, f):  # type: ignore[no-untyped-def]
    """``series`` := derivatives of (z, f) where the step from ``s`` begins, as many as it takes until ``theta``.

    f of ``s`` is about the step's middle; ``f`` is room for it about the beginning.

    Returns:
        how many there are.
    """
    count, signals = T.terms[int(np.ceil(theta * (len(T.terms) - 1)))], T.M.shape[1] - m
    powers = (len(s) - m) // signals if signals > 0 else 0
    copy(s, series[0, :m])
    move(s[m:], -0.5, signals, f)
    # d^{j+1} z = h M d^j z + h D d^j f
    for j in range(min(powers, count)):
        copy(f[j * signals :], series[j, m:])
        times(T.M, series[j], series[j + 1, :m])
    for j in range(powers, count):
        times(T.M, series[j, :m], series[j + 1, :m])
    return count + 1


@compiled
def multiply(T, run):  # type: ignore[no-untyped-def]
    """Set the products of noises and the hold where a piece begins, which ends at the next of their points."""
    now, counts, t, m = run.now, run.counts, run.now[Now.TIME], len(run.row)
    while T.points[counts[Count.STRETCH]] <= t:
        counts[Count.STRETCH] += 1
    k, n, noises = counts[Count.STRETCH], len(T.H), T.lines.shape[1]
    now[Now.STOP] = min(now[Now.STOP], T.points[k])
    x_h = run.s[:n]  # room: it is filled with w after this
    times(T.H, run.w[:m], x_h)
    for j in range(noises):
        slope = T.lines[k, j, 1]
        value, p = T.lines[k, j, 0] + slope * (t - T.begins[k]), m - 2 * n * (noises - j)
        for i in range(n):
            run.w[p + i], run.w[p + n + i] = value * x_h[i], slope * x_h[i]
    counts[Count.AGE] = FRESH  # rows do not go on from the last one


@fused
def at(series, count, theta, result):  # type: ignore[no-untyped-def]
    """``result`` := the sum of ``count`` terms of Taylor's ``series`` at ``theta``."""
    copy(series[count - 1], result)
    for j in range(count - 1, 0, -1):
        term, share = series[j - 1], theta / j
        for i in range(len(result)):
            result[i] = result[i] * share + term[i]


@compiled
def _beside(T, m, begin, end, series, f, f_begin, z):  # type: ignore[no-untyped-def]
    """``z`` := z at ``end`` of a disturbed step, from z at ``begin`` close by, which ``series`` begins with.

    ``f`` is about the step's middle; ``f_begin`` is room for it about ``begin``.
    """
    signals = T.M.shape[1] - m
    powers = min(len(f) // signals, T.near)
    if powers > 0:
        move(f, begin - 0.5, signals, f_begin)
    for j in range(powers):
        copy(f_begin[j * signals :], series[j, m:])
        times(T.M, series[j], series[j + 1, :m])
    for j in range(powers, T.near):
        times(T.M, series[j, :m], series[j + 1, :m])
    at(series, T.near + 1, end - begin, z)


@compiled
def forward(T, s, m, theta, series, f, z):  # type: ignore[no-untyped-def]
    """``z`` := z at ``theta`` of the disturbed step from ``s``: a matrix to the nearest place, then few terms."""
    last = len(T.ahead) - 1
    place = int(theta * last + 0.5)
    times(T.ahead[place], s, series[0, :m])
    _beside(T, m, place / last, theta, series, s[m:], f, z)


@compiled
def backward(T, s, m, theta, series, f, z):  # type: ignore[no-untyped-def]
    """z of ``s``, which is that at ``theta`` of a disturbed step := z where that step begins; ``z`` is room.

    Without f in ``s``, it is what nothing acts on: the difference of two motions.
    """
    last = len(T.back) - 1
    place = int(theta * last + 0.5)
    copy(s, series[0, :m])
    _beside(T, m, theta, place / last, series, s[m:], f, s[:m])
    times(T.back[place], s, z)
    copy(z, s[:m])


_LARGE, _TINY, _NORMAL = 1e8, 1e-290, 2.3e-308
NOTHING, EVENT, FALL = 0, 1, 2  # what ends a step


@compiled
def first_end(A, F, F2, cuts, n_pos, s, armed, falls, since, ready, work):  # type: ignore[no-untyped-def]
    """(kind, θ) of the first end on the step from ``s``: by the bounds of the whole series, then by roots.

    A fall counts from ``since`` on, an event from ``ready`` on; of both at one place it is the fall.
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
