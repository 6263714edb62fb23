"""A controller as a hybrid linear system, a stretch at a time, in compiled code for both plants.

The method of steps: over a stretch no longer than the shortest delay the delayed readings are known from history. If
these are all, so are the controller's state and its command, whatever the plant does meanwhile (:func:`foresee`). If it
reads current outputs too, plant and controller move together under what is known ahead, which is a polynomial in time.
A stretch ends where something is not smooth. Recurring arguments are those of :mod:`icmj.simulation.taps`:
``taps``, ``history`` and ``now``.

An instant is of *level* L if derivative L + 1 of what is read is the first that jumps there: −1 if the reading itself
does. A switch, like anything that lets an input jump, is of level 0. What a controller makes of an instant of level L
is of level L + 1, one delay later: the readings go into the command, and the plant integrates that at least once.

What is due at an instant happens in the order of :mod:`icmj.simulation.native.loop`. Guards beyond zero and faces of
the rule beyond 1 are found where the next stretch begins (:func:`turn`), the earlier root first; a face that is reached
is what the rule calls an event. What is reached within :data:`ONE_INSTANT` of an instant at which something is due is
reached there, and waits for that (:func:`cut`).
"""

from __future__ import annotations

from math import comb

import numpy as np

from icmj.base.compilation import compiled, inlined, merged
from icmj.base.instants import ONE_INSTANT
from icmj.base.roots import evaluate, first_root
from icmj.simulation.native.loop import (
    ACTED,
    EDGE,
    LAST,
    PLANNED,
    READY,
    RESET,
    SIGNAL,
    Status,
    await_sample,
    is_due,
    is_watched,
    next_event,
    next_instant,
    plan_after,
    take_action,
)
from icmj.simulation.native.waves import add_waves

SMOOTH = 1 << 20  # the level of a smooth instant
MEETS, ENDS, SWITCHES, FALLS, MOVES, TURNS, READS = 0, 1, 2, 3, 4, 5, 6  # of now.met
BEFORE = 1  # of now.mode
KEPT = -1  # of the row after a jump, whose mode is then written as KEPT - mode: it stays, and not the row before
_BENDS = 1  # the level of what is read from which on a command is smooth but for its second derivative
_RUNNING, _COMPLETED, _FELL = int(Status.RUNNING), int(Status.COMPLETED), int(Status.FELL)
_DIVERGED = 1e12  # of the controller's state
_MOST_SWITCHES, _SOON = 5000, 1e-3  # so many stretches in a row that end in a switch, none as long as this [units]
_NOTHING = 1e-300  # less than the square of any reading
_STRAIGHT = 1e-7  # units of time; what goes on in less is straight to rounding
_SEAM = 1e-7  # relative: what polynomials of two stretches may differ by where they meet
_BINOMIAL = np.array([[float(comb(k + m, k)) for m in range(32)] for k in range(32)])
_ROUNDING = 64 * 2.2e-16  # of the sum of a guard's terms: what its sign may be wrong by


@compiled
def shift(row, by, room):  # type: ignore[no-untyped-def]
    """Coefficients of a polynomial about a place ``by`` further on, in place: Σ_m C(k + m, k) by^m a_(k+m).

    ``room`` is as long as the row, for the sums. Unlike those of Horner's scheme, they do not depend on one another.
    """
    last = len(row) - 1
    while last > 0 and row[last] == 0:
        last -= 1
    power = by
    for k in range(last + 1):
        room[k] = row[k]
    for m in range(1, last + 1):
        for k in range(last + 1 - m):
            room[k] += _BINOMIAL[m, k] * power * row[k + m]
        power *= by
    for k in range(last + 1):
        row[k] = room[k]


@compiled
def reached(taps, history, t, level):  # type: ignore[no-untyped-def]
    """The level of the stretch that begins at ``t``, and when the next instant that is not smooth is read."""
    next_rough = np.inf
    for i in range(len(taps.tau)):
        k = history.ahead[i]
        while k < history.count[0]:
            rough = history.level[k] < taps.rough
            if rough and history.start[k] + taps.tau[i] > t + ONE_INSTANT:
                next_rough = min(next_rough, history.start[k] + taps.tau[i])
                break
            if rough:
                level = min(level, history.level[k] + 1)
            k += 1
        history.ahead[i] = k
    return level, next_rough


@compiled
def settle(taps, values, length, out, room):  # type: ignore[no-untyped-def]
    """Into ``out``, shape (rows, p + 1): the polynomials about the begin of a stretch from their values at its nodes.

    ``values`` has shape (nodes, rows), ``length`` is that of the stretch in units of time; ``room`` is as long as a row
    of ``out``.
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
        shift(out[i], -half, room)


@compiled
def _read(taps, history, now, t, end):  # type: ignore[no-untyped-def]
    """The delayed readings and the signals from ``t`` to ``end`` into ``now.v``, about ``t``."""
    n_y, unit, last, direct = history.r.shape[1], taps.unit, history.count[0] - 1, taps.direct
    for i in range(len(taps.tau)):
        tau, k = taps.tau[i], history.at[i]
        rows = now.v[direct + i * n_y : direct + (i + 1) * n_y]
        middle = (t + end) / 2 - tau
        while k < last and history.start[k + 1] <= (middle if taps.exact else t - tau + ONE_INSTANT):
            k += 1
        history.at[i] = k
        if taps.exact or k == last or history.start[k + 1] >= end - tau - ONE_INSTANT:
            # a Taylor series holds beyond its stretch, too, where nothing jumps
            for row in range(n_y):
                for j in range(now.v.shape[1]):
                    rows[row, j] = history.r[k, row, j]
                shift(rows[row], (t - tau - history.start[k]) / unit, now.g)
            continue
        for node in range(len(taps.nodes)):
            s = middle + (end - t) / 2 * taps.nodes[node]
            while k < last and history.start[k + 1] <= s:
                k += 1
            for row in range(n_y):
                r = history.r[k, row]
                now.values[node, row] = evaluate(r, len(r) - 1, (s - history.start[k]) / unit)
        settle(taps, now.values, (end - t) / unit, rows, now.g)
    signals = now.v[direct + len(taps.tau) * n_y :]
    if len(signals) > 0:
        for i in range(len(signals)):
            for j in range(signals.shape[1]):
                signals[i, j] = 0.0
        add_waves(taps.signals, t, end, unit, signals)


@compiled
def _map(matrix, now):  # type: ignore[no-untyped-def]
    """a := matrix a."""
    for i in range(len(now.a)):
        total = 0.0
        for k in range(len(now.a)):
            total += matrix[i, k] * now.a[k]
        now.after[i] = total
    for i in range(len(now.a)):
        now.a[i] = now.after[i]


@compiled
def until(taps, now, t, longest):  # type: ignore[no-untyped-def]
    """When the next thing happens to the controller by itself, at most ``longest`` [s]."""
    end = next_instant(taps, now, min(taps.edges[now.due[SIGNAL]], now.due[RESET] * taps.period), longest)
    if len(taps.cuts) > 1 and not is_watched(now, t):
        end = min(end, now.when[READY])
    return end


@compiled
def is_crowded(now):  # type: ignore[no-untyped-def]
    """Whether there is no room in the queue for one action more."""
    return now.due[PLANNED] - now.due[ACTED] >= len(now.queue) - 1


@compiled
def is_armed(taps, now, t):  # type: ignore[no-untyped-def]
    """Whether the event rule is watched from ``t`` on."""
    return len(taps.cuts) > 1 and is_watched(now, t) and taps.watched[now.mode[0]]


@compiled
def beyond(taps, now):  # type: ignore[no-untyped-def]
    """Whether the state is at or beyond a face of the event rule."""
    for face in range(len(taps.cuts) - 1):
        square = 0.0
        for row in range(taps.cuts[face], taps.cuts[face + 1]):
            part = 0.0
            for k in range(len(now.a)):
                part += taps.R[row, k] * now.a[k]
            square += part * part
        if square >= 1:
            return True
    return False


@compiled
def _turn_of_face(taps, now, face, length):  # type: ignore[no-untyped-def]
    """Where on [0, 1] of the stretch the state reaches a face |R_j a| = 1; infinity where it does not."""
    g, p, most = now.g, now.A.shape[1] - 1, 0.0
    row_of = now.stack[0]
    for j in range(len(g)):
        g[j] = 0.0
    g[0] = -1.0
    for row in range(taps.cuts[face], taps.cuts[face + 1]):
        size, scale = 0.0, 1.0
        for j in range(p + 1):
            part = 0.0
            for k in range(len(now.a)):
                part += taps.R[row, k] * now.A[k, j]
            row_of[j] = part * scale
            size += abs(row_of[j])
            scale *= length
        most += size * size
        for j in range(p + 1):
            if row_of[j] != 0:
                for k in range(p + 1):
                    g[j + k] += row_of[j] * row_of[k]
    if most < 1:
        return np.inf
    return first_root(g, len(g) - 1, taps.F, now.stack, now.spans)


@compiled
def turn(taps, now, length, armed):  # type: ignore[no-untyped-def]
    """Where on [0, length] the sign of a guard changes first or a face is reached, and of which; infinity and −1.

    What is reached less than :data:`ONE_INSTANT` later is found, too. Faces are numbered behind the guards, and looked
    at if the rule is ``armed``. A sign has changed where the guard is beyond zero by more than rounding, and by more
    than it is so already at the begin, where polynomials of two stretches meet: so none changes back because they do
    not quite.
    Where the largest that the guard can become on the stretch is below zero, no more is asked.
    """
    first, which, n_v, p = np.inf, -1, now.v.shape[0], now.v.shape[1] - 1
    n, g, reach = len(now.reach), now.g, now.reach
    length += ONE_INSTANT / taps.unit
    if len(taps.c) > 0:
        for i in range(n):
            if taps.used[i]:
                row = now.v[i] if i < n_v else now.A[i - n_v]
                total, scale = 0.0, 1.0
                for j in range(1, p + 1):
                    scale *= length
                    total += abs(row[j]) * scale
                reach[i] = total
    for guard in range(len(taps.c)):
        now.roots[guard] = np.inf
        sign = -1.0 if now.sign[guard] != 0 else 1.0
        value, size, most = taps.c[guard], abs(taps.c[guard]), 0.0
        for i in range(n):
            for k in range(n):
                q = taps.Q[guard, i, k]
                if q != 0:
                    here = now.v[i, 0] if i < n_v else now.A[i - n_v, 0]
                    there = now.v[k, 0] if k < n_v else now.A[k - n_v, 0]
                    value += q * here * there
                    most += abs(q) * (abs(here) * reach[k] + reach[i] * abs(there) + reach[i] * reach[k])
                    size += abs(q) * (abs(here) + reach[i]) * (abs(there) + reach[k])
        if sign * value + most < 0:
            continue
        for j in range(len(g)):
            g[j] = 0.0
        g[0] = taps.c[guard]
        for i in range(n):
            for k in range(n):
                q = taps.Q[guard, i, k]
                if q == 0:
                    continue
                one = now.v[i] if i < n_v else now.A[i - n_v]
                other = now.v[k] if k < n_v else now.A[k - n_v]
                for j in range(p + 1):
                    if one[j] != 0:
                        by = q * one[j]
                        for m in range(p + 1):
                            g[j + m] += by * other[m]
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
        now.roots[guard] = theta * length
        if theta < first:
            first, which = theta, guard
    if armed:
        for face in range(len(taps.cuts) - 1):
            theta = _turn_of_face(taps, now, face, length)
            if theta < first:
                first, which = theta, len(taps.c) + face
    return first * length, which


@compiled
def cut(taps, now, t, end):  # type: ignore[no-untyped-def]
    """Where the stretch from ``t`` ends, at ``end`` at the latest, and the guard or face that ends it, or −1.

    What is reached at the stretch's end is looked at again where the next one begins, after what is due there:
    ``now.met`` says which it is.
    """
    now.met[MEETS] = -1
    theta, guard = turn(taps, now, (end - t) / taps.unit, is_armed(taps, now, t))
    if guard < 0:
        return end, -1
    at = t + theta * taps.unit
    if end > t and at >= end - ONE_INSTANT:
        now.met[MEETS] = guard
        return end, -1
    return (t if at - t <= ONE_INSTANT else min(at, end)), guard


@compiled
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


@inlined
def meets(instants, t):  # type: ignore[no-untyped-def]
    """Whether one of rising instants, of which the last is infinite, is ``t``."""
    return instants[np.searchsorted(instants, t - ONE_INSTANT)] <= t + ONE_INSTANT


@compiled
def open_stretch(taps, history, now, t, longest, level):  # type: ignore[no-untyped-def]
    """The level of the stretch from ``t`` on and its end, ``longest`` at most; ``now.v`` is what is known of it."""
    read, next_rough = reached(taps, history, t, SMOOTH)
    level, now.met[READS] = min(level, read), read <= _BENDS
    end = min(t + taps.unit, next_rough, until(taps, now, t, longest))
    _read(taps, history, now, t, end)
    return level, end


@compiled
def foresee(taps, history, now, t, longest, level):  # type: ignore[no-untyped-def]
    """The stretch of a controller that only reads delayed outputs: its level, its end, and what ends it, or −1.

    ``now.v``, ``now.A`` and ``now.u`` are readings, state and command on it; ``level`` is that of what else begins
    there.
    """
    level, end = open_stretch(taps, history, now, t, longest, level)
    _command(taps, now)
    end, guard = cut(taps, now, t, end)
    return level, end, guard


@compiled
def leave(taps, now, length, guard):  # type: ignore[no-untyped-def]
    """Take the controller to the stretch's end, ``length`` units on, where a guard or face is reached, or −1."""
    p = now.A.shape[1] - 1
    for i in range(len(now.a)):
        now.a[i] = evaluate(now.A[i], p, length)
    now.met[SWITCHES] = now.met[SWITCHES] + 1 if 0 <= guard < len(now.sign) and length < _SOON else 0
    now.met[ENDS], now.met[MOVES] = guard, length > 0
    if length > 0:  # a command on a stretch of no length was never given
        now.mode[BEFORE] = now.mode[0]
        for i in range(len(now.last)):
            now.last[i] = evaluate(now.u[i], p, length)


@compiled
def is_sound(now):  # type: ignore[no-untyped-def]
    """Whether the controller's state is finite, and not beyond what any plant could follow."""
    size = 0.0
    for i in range(len(now.a)):
        size += abs(now.a[i])
    return size <= _DIVERGED  # false for NaN, too


@compiled
def is_still(now):  # type: ignore[no-untyped-def]
    """Whether the modes switch to and fro and time does not advance."""
    return now.met[SWITCHES] > _MOST_SWITCHES


@compiled
def choose(taps, now):  # type: ignore[no-untyped-def]
    """The mode that follows by the signs of the guards; whether it is another."""
    signs = 0
    for guard in range(len(now.sign)):
        signs += now.sign[guard] << guard
    before = now.mode[0]
    now.mode[0] = taps.table[before, signs]
    return now.mode[0] != before


@compiled
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
        for i in range(history.r.shape[1]):
            for j in range(history.r.shape[2]):
                history.r[k - gone, i, j] = history.r[k, i, j]
    history.count[0] = count - gone
    for i in range(len(history.at)):
        history.at[i] -= gone
        history.ahead[i] -= gone
    return history.count[0] <= len(history.start) // 2


@compiled
def remember(history, t, level):  # type: ignore[no-untyped-def]
    """Number of the readings of a stretch that begins at ``t``: polynomials about it, which the caller fills in."""
    k = history.count[0]
    history.start[k], history.level[k] = t, level
    history.count[0] = k + 1
    return k


# verbs of :mod:`icmj.simulation.native.loop`, the same for the stretches of both plants: ``f`` has ``taps``, ``now``,
# ``time`` (whose first is now), ``edges`` and ``levels`` of what acts, and the ``end`` of the run. A plant's own verbs
# are ``travel`` and ``note``. The first takes one stretch (open_stretch or foresee, cut, remember, leave), and leaves
# the level of what begins then, which is SMOOTH unless a verb says otherwise, and in now.met what the stretch has met.


@merged
def change(f):  # type: ignore[no-untyped-def]
    """Pass the edges that are due, and those of signals, which may move the controller's state."""
    taps, now, t = f.taps, f.now, f.time[0]
    while is_due(f.edges[now.due[EDGE]], t):
        now.level[0] = min(now.level[0], f.levels[now.due[EDGE]])
        now.due[EDGE] += 1
    while is_due(taps.edges[now.due[SIGNAL]], t):
        for k in range(len(taps.signals.terms)):
            start = taps.signals.terms[k, 3]
            if start == taps.edges[now.due[SIGNAL]] and taps.signals.terms[k, 4] == start:
                for i in range(len(now.a)):
                    for j in range(taps.signals.effect.shape[1]):
                        by = taps.signals.effect[k, j] * taps.signals.terms[k, 0]
                        now.a[i] += taps.N[now.mode[0], i, now.v.shape[0] - taps.signals.effect.shape[1] + j] * by
        now.due[SIGNAL] += 1
        now.level[0] = -1
    return now.level[0] < 0


@merged
def act(f):  # type: ignore[no-untyped-def]
    """Carry out actions and resets of the period that are due."""
    taps, now, t, acts = f.taps, f.now, f.time[0], False
    while take_action(now, t):
        _map(taps.jump, now)
        acts = True
    while is_due(now.due[RESET] * taps.period, t):
        _map(taps.J, now)
        now.due[RESET] += 1
        acts = True
    if acts:
        now.level[0] = -1
    return acts


@merged
def tick(f):  # type: ignore[no-untyped-def]
    """Whether the clock ticks, or the sample is taken."""
    return is_due(next_event(f.taps, f.now), f.time[0])


@merged
def cross(f, moved):  # type: ignore[no-untyped-def]
    """What the guard or face does that has been reached; whether it is an event.

    A guard or face that was met where something else is due, or that is beyond its level after what has ``moved``
    there, is found where the next stretch begins, which may have no length. At the end, or after a fall, none begins,
    so it is judged here. Guards whose signs change at one instant change them together. Without events proper a switch
    is an event, but only once at an instant.
    """
    taps, now, t = f.taps, f.now, f.time[0]
    guard, guards = now.met[ENDS], len(taps.c)
    if guard < 0 and (is_over(f) or now.met[FALLS] != 0):
        if is_armed(taps, now, t) and (beyond(taps, now) or (now.met[MEETS] >= guards and not moved)):
            guard = guards
        elif 0 <= now.met[MEETS] < guards and not moved:
            guard = now.met[MEETS]
    now.met[ENDS], now.met[TURNS] = -1, 0
    if guard >= guards:
        return await_sample(taps, now, t)
    if guard < 0:
        return False
    for other in range(guards):
        if other == guard or now.roots[other] - now.roots[guard] <= ONE_INSTANT / taps.unit:
            now.sign[other] = 1 - now.sign[other]
    if not choose(taps, now):
        return False
    now.level[0], now.met[TURNS] = min(now.level[0], 0), now.met[MOVES]
    return not is_eventful(taps) and t > now.when[LAST]


@merged
def fire(f):  # type: ignore[no-untyped-def]
    """An event: the state's jump, the mode that follows, and what is planned after it."""
    taps, now, t = f.taps, f.now, f.time[0]
    now.when[LAST] = t
    if is_eventful(taps):  # else it was a switch
        _map(taps.J, now)
        plan_after(taps, now, t)
        now.mode[0] = taps.after[now.mode[0]]
        choose(taps, now)
        now.level[0] = -1


@merged
def end(f, event):  # type: ignore[no-untyped-def]
    """Whether the run ends, and how."""
    if f.now.met[FALLS] != 0:
        return _FELL
    return _COMPLETED if is_over(f) else _RUNNING


@merged
def is_over(f):  # type: ignore[no-untyped-def]
    """Whether this is the run's last instant."""
    return is_due(f.end, f.time[0])


@compiled
def is_eventful(taps):  # type: ignore[no-untyped-def]
    """Whether the controller has events proper: a rule or a clock."""
    return len(taps.cuts) > 1 or taps.clock < np.inf
