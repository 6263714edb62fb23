"""The flow of the linear plant under any controller, stretch by stretch.

The verbs that :mod:`icmj.simulation.native.loop` calls; there stands what comes first at an instant.

On a stretch (:mod:`icmj.simulation.native.taps`) what is read of earlier is a polynomial, and what disturbs a sum of
sinusoids: so the states of plant and controller are Taylor series, whose terms follow from one another. A stretch is
short enough for what the series leave out to be below rounding. Events, switches and falls are first roots of
polynomials made of them, and a stretch ends there.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import compiled, entry, exact, hash_contents, merged
from icmj.base.instants import ONE_INSTANT
from icmj.base.references import refer
from icmj.base.roots import evaluate, first_root, largest
from icmj.simulation.native.loop import (
    ARRIVED,
    EDGE,
    SIGNAL,
    Status,
    is_due,
    run_loop,
    sources,
)
from icmj.simulation.native.taps import (
    BEFORE,
    FALLS,
    KEPT,
    READS,
    SMOOTH,
    TURNS,
    act,
    change,
    cross,
    cut,
    end,
    fire,
    is_crowded,
    is_over,
    is_sound,
    is_still,
    leave,
    meets,
    open_stretch,
    remember,
    room,
    shift,
    tick,
)
from icmj.simulation.native.waves import Waves, add_waves
from icmj.simulation.taps import ControllerState, History, Taps

_DIVERGED = 1e12
_RUNNING, _FULL = int(Status.RUNNING), int(Status.FULL)
_FELL, _GONE, _STALLED = int(Status.FELL), int(Status.DIVERGED), int(Status.STALLED)
_CELLS = 2000  # stretches before the caller is asked, who may have been interrupted


class Grid(NamedTuple):
    """Sums of sinusoids that last the whole run, as polynomials on cells that are one unit of time long.

    Attributes:
        first: number of the first cell.
        f: coefficients about the middle of each cell, shape (cells, S, p + 1).
        effect: what each of the S sums does, shape (S, rows).
    """

    first: int
    f: Array
    effect: Array


class Body(NamedTuple):
    """The plant, what acts on it, and what a run needs; rates are per unit of time of the taps.

    Attributes:
        A, B, C: shapes (n, n), (n, n_u), (n_y, n).
        acting: on the state, n rows, without what lasts the whole run.
        errors: of the outputs as they are read, n_y rows, without what lasts the whole run.
        lasting, wrong: the sinusoids of acting and of errors that last the whole run.
        edges, levels: instants at which something begins or ends, rising, then infinity, and the level of each.
        positions: states that are limited, divided by their limits, shape (L, n).
        interval: between rows [s].
        end: of the run [s].
        F: to Bernstein coefficients, degree p.
        breaks: instants at which there are rows besides, rising, then infinity [s].
    """

    A: Array
    B: Array
    C: Array
    acting: Waves
    errors: Waves
    lasting: Grid
    wrong: Grid
    edges: Array
    levels: np.ndarray
    positions: Array
    interval: float
    end: float
    F: Array
    breaks: Array


class Track(NamedTuple):
    """Where a run is, and what it records.

    Attributes:
        t: now, the last row, and when the next row beside those of the interval is due [s], shape (3,).
        counts: next row by number, rows, events, stretches until the caller is asked, and whether of two rows at an
            instant the second is to stay; shape (5,).
        X: state on the stretch, shape (n, p + 1).
        y: outputs, and a row to work in, shape (n_y + 1, p + 1).
        room: to work in, shape (2, p + 1).
        high, low: extremes of outputs since the last event.
        rows: (t, x, u, mode), shape (capacity, 2 + n + n_u).
        events: (t, x, y_max, y_min), shape (capacity, 1 + n + 2 n_y).
    """

    t: Array
    counts: np.ndarray
    X: Array
    y: Array
    room: Array
    high: Array
    low: Array
    rows: Array
    events: Array


@compiled
def _add_lasting(grid, t, unit, room, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` what a grid does from ``t`` on, about ``t``; ``room`` has two rows."""
    if len(grid.effect) == 0:
        return
    place = t / unit
    cell = int(np.floor(place))
    row = room[0]
    for s in range(len(grid.effect)):
        for j in range(len(row)):
            row[j] = grid.f[cell - grid.first, s, j]
        shift(row, place - cell - 0.5, room[1])
        for i in range(len(out)):
            if grid.effect[s, i] != 0:
                for j in range(out.shape[1]):
                    out[i, j] += grid.effect[s, i] * row[j]


@compiled
def _reaches(grid, t, unit):  # type: ignore[no-untyped-def]
    """Whether a grid knows what acts at ``t``."""
    return len(grid.effect) == 0 or 0 <= np.floor(t / unit) - grid.first < len(grid.f)


@exact
def _follow(taps, body, now, track, t, end):  # type: ignore[no-untyped-def]
    """The Taylor series of plant, controller, command and current outputs, from the states at the stretch's begin.

    Coefficient j + 1 of the states follows from coefficient j of everything: of the outputs, hence the readings, hence
    the command.
    """
    X, n, n_y, size, p = track.X, len(track.X), len(body.C), len(now.a), track.X.shape[1] - 1
    mode, v, A, u, direct = now.mode[0], now.v, now.A, now.u, taps.direct
    M, N, K, S = taps.M[mode], taps.N[mode], taps.K[mode], taps.S[mode]
    # what acts, coefficient j of it in place j + 1, where it waits for its turn
    ahead = X[:, 1:]
    for i in range(n):
        for j in range(p):
            ahead[i, j] = 0.0
    add_waves(body.acting, t, end, taps.unit, ahead)
    _add_lasting(body.lasting, t, taps.unit, track.room, ahead)
    for i in range(direct):
        for j in range(p + 1):
            v[i, j] = 0.0
    if direct > 0:
        add_waves(body.errors, t, end, taps.unit, v[:direct])
        _add_lasting(body.wrong, t, taps.unit, track.room, v[:direct])
    for i in range(size):
        A[i, 0] = now.a[i]
    for j in range(p + 1):
        for i in range(n_y):
            total = 0.0
            for k in range(n):
                total += body.C[i, k] * X[k, j]
            track.y[i, j] = total
        for i in range(direct):
            v[i, j] += track.y[i, j]
        for i in range(len(u)):
            total = 0.0
            for k in range(size):
                total -= K[i, k] * A[k, j]
            for k in range(len(v)):
                total -= S[i, k] * v[k, j]
            u[i, j] = total
        if j == p:
            break
        by = 1.0 / (j + 1)
        for i in range(n):
            rate = X[i, j + 1]
            for k in range(n):
                rate += body.A[i, k] * X[k, j]
            for k in range(len(u)):
                rate += body.B[i, k] * u[k, j]
            X[i, j + 1] = rate * by
        for i in range(size):
            rate = 0.0
            for k in range(size):
                rate += M[i, k] * A[k, j]
            for k in range(len(v)):
                rate += N[i, k] * v[k, j]
            A[i, j + 1] = rate * (taps.unit * by)


@compiled
def _fallen(body, now, track, length):  # type: ignore[no-untyped-def]
    """Where on [0, length] a position passes its limit first; infinity where none does."""
    first, p = np.inf, track.X.shape[1] - 1
    row = track.y[-1]
    for limit in range(len(body.positions)):
        size, scale = 0.0, 1.0
        for j in range(p + 1):
            total = 0.0
            for k in range(len(track.X)):
                total += body.positions[limit, k] * track.X[k, j]
            row[j] = total * scale
            size += abs(row[j])
            scale *= length
        if size < 1:
            continue
        for _ in range(2):
            row[0] -= 1.0
            first = min(first, first_root(row, p, body.F, now.stack, now.spans))
            row[0] += 1.0
            for j in range(p + 1):
                row[j] = -row[j]
    return first * length


@exact
def _extremes(body, now, track, length):  # type: ignore[no-untyped-def]
    p = track.X.shape[1] - 1
    for i in range(len(body.C)):
        y, reach, scale = track.y[i], 0.0, 1.0
        for j in range(1, p + 1):
            scale *= length
            reach += abs(y[j]) * scale
        if y[0] + reach > track.high[i]:
            track.high[i] = largest(y, p, 1.0, length, track.high[i], body.F, now.stack, now.spans)
        if y[0] - reach < track.low[i]:
            track.low[i] = -largest(y, p, -1.0, length, -track.low[i], body.F, now.stack, now.spans)


@compiled
def _pass_rows(body, track, t):  # type: ignore[no-untyped-def]
    """A row at ``t`` is the last; rows that were due there are."""
    track.t[1] = t
    if track.counts[0] * body.interval <= t + ONE_INSTANT:
        track.counts[0] += 1
    if track.t[2] <= t + ONE_INSTANT:
        track.t[2] = body.breaks[np.searchsorted(body.breaks, t + ONE_INSTANT, side="right")]


@compiled
def _row(body, now, track, t, theta):  # type: ignore[no-untyped-def]
    """Record where it is ``theta`` units after the stretch's begin."""
    n, p, row = len(track.X), track.X.shape[1] - 1, track.rows[track.counts[1]]
    row[0] = t
    for i in range(n):
        row[1 + i] = evaluate(track.X[i], p, theta)
    for i in range(len(now.u)):
        row[1 + n + i] = evaluate(now.u[i], p, theta)
    again = t <= track.t[1] and track.counts[4] != 0
    row[1 + n + len(now.u)] = KEPT - now.mode[0] if again else now.mode[0]
    track.counts[1] += 1
    _pass_rows(body, track, t)


@compiled
def _row_here(body, now, track, t):  # type: ignore[no-untyped-def]
    """Record the state at the end of the last stretch, with the command and the mode that led there, if none is yet."""
    if t <= track.t[1]:
        return
    n, row = len(track.X), track.rows[track.counts[1]]
    row[0] = t
    for i in range(n):
        row[1 + i] = track.X[i, 0]
    for i in range(len(now.u)):
        row[1 + n + i] = now.last[i]
    row[1 + n + len(now.u)] = now.mode[BEFORE]
    track.counts[1] += 1
    _pass_rows(body, track, t)


class Stretches(NamedTuple):
    """All that the flow works on, and what the verbs of all stretches take (:mod:`icmj.simulation.native.taps`)."""

    taps: Taps
    body: Body
    history: History
    now: ControllerState
    track: Track
    time: Array
    edges: Array
    levels: np.ndarray
    end: float


@merged
def _travel(f):  # type: ignore[no-untyped-def]
    """One stretch."""
    taps, body, history, now, track = f.taps, f.body, f.history, f.now, f.track
    n, n_y, counts, X, t = len(track.X), len(body.C), track.counts, track.X, track.t[0]
    p = X.shape[1] - 1
    most = int(min(taps.unit / body.interval, 1e9)) + 8  # rows of a stretch
    counts[3] -= 1
    if counts[3] < 0 or counts[1] + most > len(track.rows) or counts[2] + 2 >= len(track.events):
        return _RUNNING
    if is_crowded(now) or not room(history):
        return _FULL
    if is_still(now):
        return _STALLED
    if not (_reaches(body.lasting, t, taps.unit) and _reaches(body.wrong, t, taps.unit)):
        return _RUNNING
    if is_due(min(body.edges[now.due[EDGE]], taps.edges[now.due[SIGNAL]]), t):  # where the run begins
        return ARRIVED
    level, end = open_stretch(taps, history, now, t, min(body.end, body.edges[now.due[EDGE]]), now.level[0])
    if now.met[READS] != 0 and len(body.errors.grids) == 0 and t > track.t[1]:  # noise that is read bends everywhere
        _row_here(body, now, track, t)
        track.t[2], counts[4] = t, 1
    _follow(taps, body, now, track, t, end)
    end, guard = cut(taps, now, t, end)
    length = (end - t) / taps.unit
    fallen = _fallen(body, now, track, length)
    # a fall where something is due comes after it
    now.met[FALLS] = fallen <= length and t + fallen * taps.unit >= end - ONE_INSTANT and (end > t or guard >= 0)
    falls = fallen <= length and now.met[FALLS] == 0
    if falls:
        length, guard = fallen, -1
        end = t + length * taps.unit
    _extremes(body, now, track, length)
    while min(counts[0] * body.interval, track.t[2]) < end - ONE_INSTANT:
        at = min(counts[0] * body.interval, track.t[2])
        _row(body, now, track, at, (at - t) / taps.unit)
    if len(taps.tau) > 0:
        rows = history.r[remember(history, t, level)]
        for i in range(n_y):
            for j in range(p + 1):
                rows[i, j] = track.y[i, j]
        add_waves(body.errors, t, end, taps.unit, rows[:n_y])
        _add_lasting(body.wrong, t, taps.unit, track.room, rows[:n_y])
        for i in range(n_y, len(rows)):  # commands, which it reads, too
            for j in range(p + 1):
                rows[i, j] = now.u[i - n_y, j]
    leave(taps, now, length, guard)
    size = 0.0
    for i in range(n):
        X[i, 0] = evaluate(X[i], p, length)
        size += abs(X[i, 0])
    track.t[0], now.level[0] = end, SMOOTH
    if falls:
        _row_here(body, now, track, end)
        return _FELL
    return ARRIVED if size <= _DIVERGED and is_sound(now) else _GONE


@merged
def _note(f, event, acted):  # type: ignore[no-untyped-def]
    """Record a row where run or mode end, and an event where the last stretch did, to begin the next interval.

    What an event, a change of mode, an action or an edge leads to is in the row with which the next stretch begins: a
    second one at that instant, which is to stay unless that is an event or a change of mode.
    """
    body, track, t, n, n_y = f.body, f.track, f.track.t[0], len(f.track.X), len(f.body.C)
    turned, planned = event or f.now.met[TURNS] != 0, acted or meets(body.breaks, t)
    if turned or planned or is_over(f) or f.now.met[FALLS] != 0:
        _row_here(body, f.now, track, t)
    if t > 0 and (turned or planned):
        track.t[2], track.counts[4] = t, 0 if turned else 1
    if not event:
        return
    row = track.events[track.counts[2]]
    row[0] = t
    for i in range(n):
        row[1 + i] = track.X[i, 0]
    for i in range(n_y):
        row[1 + n + i], row[1 + n + n_y + i] = track.high[i], track.low[i]
        total = 0.0
        for k in range(n):
            total += body.C[i, k] * track.X[k, 0]
        track.high[i] = track.low[i] = total
    track.counts[2] += 1


@compiled
def _run(flow):  # type: ignore[no-untyped-def]
    return run_loop(flow, _travel, change, act, tick, cross, _note, fire, end)


@cache
def compile_stretches() -> Any:
    """The compiled ``march(taps, body, history, now, track)``, a while on; a :class:`Status`."""
    source = hash_contents(Path(__file__).parent) + sources()

    @entry
    def march(taps, body, history, now, track):  # type: ignore[no-untyped-def]
        if source == 0:
            return _FULL
        track.counts[3] = _CELLS
        flow = Stretches(taps, body, history, now, track, track.t, body.edges, body.levels, body.end)
        return _run(refer(flow))

    return march
