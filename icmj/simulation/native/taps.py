"""A controller that reads outputs of a while ago, a stretch at a time, in compiled code for both plants.

The method of steps: over a stretch no longer than the shortest tap the readings v(t) are known from history, hence the
signs of the guards, the mode, the controller's state and its command, whatever the plant does meanwhile. A stretch ends
where something is not smooth. Arguments that come again are those of :mod:`icmj.simulation.taps`: ``taps``, ``history``
and ``now``.

*Level* L of an instant: the derivative L + 1 of what is read jumps there. A switch, like anything that lets an input
jump, is of level 0. What a controller makes of an instant of level L is of level L + 1, a tap later: the readings go
into the command, and the plant integrates that at least once.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.compilation import allocating, contents, entry
from icmj.base.instant import SAME
from icmj.base.roots import evaluate, first_root
from icmj.simulation.native.waves import add_waves

SMOOTH = 1 << 20  # the level of a smooth instant
ROUGH = 12  # levels above are smooth to rounding: what jumps has thirteen integrals by then
_NOTHING = 1e-300  # less than the square of any reading
_STRAIGHT = 1e-7  # units of time; what goes on in less is straight to rounding
_SEAM = 1e-7  # relative: what polynomials of two stretches may differ by where they meet
_ROUNDING = 64 * 2.2e-16  # of the sum of a guard's terms: what its sign may be wrong by


@allocating
def shift(row, by):  # type: ignore[no-untyped-def]
    """Coefficients of a polynomial about a place ``by`` further on, in place (Horner's scheme)."""
    last = len(row) - 1
    while last > 0 and row[last] == 0:
        last -= 1
    for k in range(last):
        for j in range(last - 1, k - 1, -1):
            row[j] += by * row[j + 1]


@allocating
def reached(taps, history, t, level):  # type: ignore[no-untyped-def]
    """The level of the stretch that begins at ``t``, and when the next instant that is not smooth is read."""
    next = np.inf
    for i in range(len(taps.tau)):
        k = history.ahead[i]
        while k < history.count[0]:
            rough = history.level[k] < ROUGH
            if rough and history.start[k] + taps.tau[i] > t + SAME:
                next = min(next, history.start[k] + taps.tau[i])
                break
            if rough:
                level = min(level, history.level[k] + 1)
            k += 1
        history.ahead[i] = k
    return level, next


@allocating
def settle(taps, values, length, out):  # type: ignore[no-untyped-def]
    """Into ``out``, shape (rows, p + 1): the polynomials about the begin of a stretch from their values at its nodes.

    ``values`` has shape (nodes, rows), ``length`` is that of the stretch in units of time.
    """
    half, last = length / 2, len(values) - 1
    for i in range(len(out)):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
        if length < _STRAIGHT:
            # further powers of so little time are rounding, and grow beyond bounds just beyond it
            out[i, 1] = (values[last, i] - values[0, i]) / (half * (taps.nodes[last] - taps.nodes[0]))
            out[i, 0] = (values[0, i] + values[last, i]) / 2 - out[i, 1] * half
            continue
        for j in range(len(taps.fit)):
            total = 0.0
            for k in range(len(taps.fit)):
                total += taps.fit[j, k] * values[k, i]
            out[i, j] = total / half**j
        shift(out[i], -half)


@allocating
def _read(taps, history, now, t, end):  # type: ignore[no-untyped-def]
    """The readings from ``t`` to ``end`` into ``now.v``, about ``t``."""
    n_y, unit, last = history.r.shape[1], taps.unit, history.count[0] - 1
    for i in range(len(taps.tau)):
        tau, k = taps.tau[i], history.at[i]
        rows = now.v[i * n_y : (i + 1) * n_y]
        middle = (t + end) / 2 - tau
        while k < last and history.start[k + 1] <= (middle if taps.exact else t - tau + SAME):
            k += 1
        history.at[i] = k
        if taps.exact or k == last or history.start[k + 1] >= end - tau - SAME:
            # a Taylor series holds beyond its stretch, too, where nothing jumps
            for row in range(n_y):
                for j in range(now.v.shape[1]):
                    rows[row, j] = history.r[k, row, j]
                shift(rows[row], (t - tau - history.start[k]) / unit)
            continue
        for node in range(len(taps.nodes)):
            s = middle + (end - t) / 2 * taps.nodes[node]
            while k < last and history.start[k + 1] <= s:
                k += 1
            for row in range(n_y):
                r = history.r[k, row]
                now.values[node, row] = evaluate(r, len(r) - 1, (s - history.start[k]) / unit)
        settle(taps, now.values, (end - t) / unit, rows)
    signals = now.v[len(taps.tau) * n_y :]
    if len(signals) > 0:
        signals[:] = 0.0
        add_waves(taps.signals, t, end, unit, signals)


@allocating
def _jump(taps, now, t, level, longest):  # type: ignore[no-untyped-def]
    """What signals and then resets do at ``t``: its level, and how far it is to the next, at most to ``longest``."""
    mode, size = now.mode[0], len(now.a)
    while taps.edges[now.due[1]] <= t + SAME:
        for k in range(len(taps.signals.terms)):
            start = taps.signals.terms[k, 3]
            if start == taps.edges[now.due[1]] and taps.signals.terms[k, 4] == start:
                for i in range(size):
                    for j in range(taps.signals.effect.shape[1]):
                        by = taps.signals.effect[k, j] * taps.signals.terms[k, 0]
                        now.a[i] += taps.N[mode, i, now.v.shape[0] - taps.signals.effect.shape[1] + j] * by
        now.due[1] += 1
        level = -1
    while now.due[0] * taps.period <= t + SAME:
        before = now.a.copy()
        for i in range(size):
            now.a[i] = 0.0
            for k in range(size):
                now.a[i] += taps.J[i, k] * before[k]
        now.due[0] += 1
        level = -1
    return level, min(longest, now.due[0] * taps.period, taps.edges[now.due[1]])


@allocating
def _turn(taps, now, length):  # type: ignore[no-untyped-def]
    """Where on [0, length] the sign of a guard changes first, and of which; infinity and −1 where none does.

    A sign has changed where the guard is beyond zero by more than rounding, and by more than it is so already at the
    begin, where polynomials of two stretches meet: so none changes back because they do not quite.
    """
    first, which, n, p = np.inf, -1, now.v.shape[0], now.v.shape[1] - 1
    g = now.g
    for guard in range(len(taps.c)):
        for j in range(len(g)):
            g[j] = 0.0
        g[0], size = taps.c[guard], abs(taps.c[guard])
        for i in range(n):
            for k in range(n):
                q = taps.Q[guard, i, k]
                if q == 0:
                    continue
                size_i, size_k, scale = 0.0, 0.0, 1.0
                for j in range(p + 1):
                    size_i += abs(now.v[i, j]) * scale
                    size_k += abs(now.v[k, j]) * scale
                    scale *= length
                size += abs(q) * size_i * size_k
                for j in range(p + 1):
                    if now.v[i, j] != 0:
                        for m in range(p + 1):
                            g[j + m] += q * now.v[i, j] * now.v[k, m]
        sign = -1.0 if now.sign[guard] != 0 else 1.0
        scale, rest = sign, 0.0
        for j in range(len(g)):
            g[j] *= scale
            scale *= length
            rest += abs(g[j]) if j > 0 else 0.0
        margin = max(_ROUNDING * size, _NOTHING)  # a guard that stays zero has not changed its sign
        if 0 < g[0] < _SEAM * size:
            margin = max(margin, 2 * g[0])
        g[0] -= margin
        if g[0] + rest < 0:
            continue
        theta = first_root(g, len(g) - 1, taps.F, now.stack, now.spans)
        if theta < first:
            first, which = theta, guard
    return first * length, which


@allocating
def _command(taps, now):  # type: ignore[no-untyped-def]
    """The controller's state and its command as polynomials, from its state and the readings."""
    mode, size, n = now.mode[0], len(now.a), now.v.shape[0]
    M, N, K, S = taps.M[mode], taps.N[mode], taps.K[mode], taps.S[mode]
    for i in range(size):
        now.A[i, 0] = now.a[i]
    for j in range(now.v.shape[1]):
        if j > 0:
            for i in range(size):
                rate = 0.0
                for k in range(size):
                    rate += M[i, k] * now.A[k, j - 1]
                for k in range(n):
                    rate += N[i, k] * now.v[k, j - 1]
                now.A[i, j] = rate * taps.unit / j
        for i in range(len(now.u)):
            total = 0.0
            for k in range(size):
                total -= K[i, k] * now.A[k, j]
            for k in range(n):
                total -= S[i, k] * now.v[k, j]
            now.u[i, j] = total


@allocating
def stretch(taps, history, now, t, longest, level):  # type: ignore[no-untyped-def]
    """The stretch from ``t`` on, as far as ``longest`` at most: its level, its end, and the guard that ends it, or −1.

    ``now.v``, ``now.A`` and ``now.u`` are readings, state and command on it; ``level`` is that of what else begins
    there.
    """
    level, longest = _jump(taps, now, t, level, longest)
    level, next = reached(taps, history, t, level)
    end = min(t + taps.unit, next, longest)
    _read(taps, history, now, t, end)
    theta, guard = _turn(taps, now, (end - t) / taps.unit)
    if guard >= 0:
        end = min(t + theta * taps.unit, end)
    _command(taps, now)
    return level, end, guard


@allocating
def leave(taps, now, length, guard):  # type: ignore[no-untyped-def]
    """Take the controller to the stretch's end, ``length`` units on; whether its mode changes there."""
    for i in range(len(now.a)):
        now.a[i] = evaluate(now.A[i], now.A.shape[1] - 1, length)
    if guard < 0:
        return False
    now.sign[guard] = 1 - now.sign[guard]
    return choose(taps, now)


@allocating
def choose(taps, now):  # type: ignore[no-untyped-def]
    """The mode that follows by the signs of the guards; whether it is another."""
    signs = 0
    for guard in range(len(now.sign)):
        signs += now.sign[guard] << guard
    before = now.mode[0]
    now.mode[0] = taps.table[before, signs]
    return now.mode[0] != before


@allocating
def room(history):  # type: ignore[no-untyped-def]
    """Whether there is room for one stretch more; forgets what no tap reads any longer."""
    count = history.count[0]
    if count < len(history.start):
        return True
    gone = count
    for i in range(len(history.at)):
        gone = min(gone, history.at[i], history.ahead[i])
    for k in range(gone, count):
        history.start[k - gone], history.level[k - gone] = history.start[k], history.level[k]
        history.r[k - gone] = history.r[k]
    history.count[0] = count - gone
    for i in range(len(history.at)):
        history.at[i] -= gone
        history.ahead[i] -= gone
    return history.count[0] <= len(history.start) // 2


@allocating
def remember(history, t, level):  # type: ignore[no-untyped-def]
    """Room for the readings of a stretch that begins at ``t``: polynomials about it, which the caller fills in."""
    k = history.count[0]
    history.start[k], history.level[k] = t, level
    history.count[0] = k + 1
    return history.r[k]


@cache
def sources() -> int:
    """A number that changes with these files."""
    return contents(Path(__file__).parent)


@cache
def entries() -> tuple[Any, Any, Any]:
    """(plan, note, go) for Python.

    ``plan(taps, history, now, t, longest, level)`` is :func:`stretch`; ``go(taps, now, length, guard)`` is
    :func:`leave`; ``note(taps, history, t, level, values, length)`` remembers what was read at the nodes of a stretch,
    and says whether there is room for more.
    """
    source = sources()

    @entry
    def plan(taps, history, now, t, longest, level):  # type: ignore[no-untyped-def]
        return stretch(taps, history, now, t, longest, level if source != 0 else 0)

    @entry
    def note(taps, history, t, level, values, length):  # type: ignore[no-untyped-def]
        settle(taps, values, length, remember(history, t, level if source != 0 else 0))
        return room(history)

    @entry
    def go(taps, now, length, guard):  # type: ignore[no-untyped-def]
        return leave(taps, now, length, guard if source != 0 else -1)

    return plan, note, go
