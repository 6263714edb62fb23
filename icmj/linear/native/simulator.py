"""The simulation of the linear plant from event to event, with everything that is recorded on the way.

Between two instants at which something is due (a *piece*) the state follows a matrix exponential. A *span* of several
steps is dismissed at once if short polynomials with a bound of what they leave out show that it holds no event, no
fall, and no extreme of an output; only the others are gone through step by step, with the whole series.

Every number that decides is a function of the state and of time alone, so neither the rows asked for nor the size of a
buffer changes a bit of the motion.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.compilation import compiled, contents, entry, inlined
from icmj.base.roots import DEEPEST
from icmj.linear.native.motion import begin_waves, copy, dot, expand, move, times, turn_waves, within
from icmj.linear.native.search import EVENT, FALL, NOTHING, doubtful, extremes, first_end
from icmj.linear.native.state import FRESH, Count, Now, Status, Work

_DIVERGED = 1e12
_LANDING = 1e-12  # an event this close after the end of a piece [s] is at its end
_SAME = 1e-12  # a recording instant this close to an event [s] is the event
_ANCHOR = 64  # rows from one to the next, before one is taken from the steps again
_PATIENCE = 20000  # spans before the caller is asked, who may have been interrupted
_GONE = 3  # beside what ends a step: it diverged
_MORE, _ENDED, _REACHED = int(Status.MORE), int(Status.ENDED), int(Status.REACHED)
_STATUS_FELL, _STATUS_DIVERGED = int(Status.FELL), int(Status.DIVERGED)


@compiled
def _note_row(run, t, z):  # type: ignore[no-untyped-def]
    k = run.counts[Count.ROWS]
    run.rows_t[k] = t
    copy(z, run.rows_z[k])
    run.counts[Count.ROWS] = k + 1
    run.now[Now.ROW] = t


@inlined
def _rows_until(T, run, until, begin, offset, scratch, spare):  # type: ignore[no-untyped-def]
    """Record the rows of the grid before ``until``, of the motion from ``run.s`` at ``begin``.

    ``offset`` is how many steps before the place that f is about the motion begins. Of quiet motion a row follows from
    the last one, which costs one matrix; of disturbed motion from where the motion begins.
    """
    m, counts = len(run.row), run.counts
    last = np.floor((until - _SAME) / T.interval)
    if counts[Count.NEXT] > last:
        return
    quiet = T.D.shape[1] == 0
    start, ahead = scratch[0, : len(run.s)], scratch[1, :m]
    copy(run.s, start)
    move(start[m:], -offset, T.D.shape[1])
    while counts[Count.NEXT] <= last:
        t = counts[Count.NEXT] * T.interval
        if quiet and counts[Count.AGE] < _ANCHOR:
            times(T.Q, run.row, ahead)
            counts[Count.AGE] += 1
        else:
            within(T.P, T.M, T.D, T.A.shape[1] - 1, start, (t - begin) / T.step, ahead, spare)
            counts[Count.AGE] = 0
        copy(ahead, run.row)
        _note_row(run, t, run.row)
        counts[Count.NEXT] += 1


@inlined
def _next_action(T, run):  # type: ignore[no-untyped-def]
    """When the clock's event that acts next does so [s]; infinite if it is still to come."""
    number = run.counts[Count.ACTED]
    if number >= run.counts[Count.TICK]:
        return np.inf
    return (number + T.ticks) * T.clock if T.ticks >= 0 else number * T.clock + T.delay


@inlined
def _open(T, run):  # type: ignore[no-untyped-def]
    """Begin a piece where the motion is: until when nothing is due."""
    now, counts, t = run.now, run.counts, run.now[Now.TIME]
    watched = len(T.cuts) > 1
    armed = watched and t >= now[Now.READY]
    due = min(now[Now.TICK], now[Now.ACTION], now[Now.EDGE])
    if watched and not armed:
        due = min(due, now[Now.READY])
    now[Now.BEGIN], now[Now.STOP] = t, min(due, T.end)
    counts[Count.STEP], counts[Count.ARMED] = 0, 1 if armed else 0
    m = len(run.row)
    copy(run.w, run.s[:m])
    if T.D.shape[1] > 0:
        begin_waves(T, run.wave, t)
        expand(T, run.wave, run.s[m:])


@inlined
def _extend(T, run, z, first):  # type: ignore[no-untyped-def]
    """Extend the extremes to the outputs at ``z``, or begin them there."""
    at = T.A.shape[0] - len(run.high)
    for k in range(len(run.high)):
        y = dot(T.A[at + k, 0, : len(z)], z)
        if first:
            run.high[k] = run.low[k] = y
        else:
            run.high[k], run.low[k] = max(run.high[k], y), min(run.low[k], y)


@inlined
def _steps(T, run, i, steps, total, last, doubts, work, turning, scratch, spare):  # type: ignore[no-untyped-def]
    """Go through steps ``i`` … ``i + steps − 1`` of the piece one by one.

    Returns:
        what ended them, how many were done, and when [s].
    """
    wild, watched, falls = doubts
    m, signals, n_y = len(run.row), T.D.shape[1], len(run.high)
    rows, s, h = T.A.shape[0], run.s, T.step
    n_pos, begin, stop = rows - T.cuts[-1] - n_y, run.now[Now.BEGIN], run.now[Now.STOP]
    ahead, asked = scratch[2, :m], stop - begin
    move(s[m:], -T.steps / 2, signals)
    kind, until = NOTHING, begin
    for k in range(steps):
        final = i + k == total - 1
        theta = last if final else 1.0
        if watched or falls:
            found, root = first_end(T.A, T.F, T.F2, T.cuts, n_pos, s, watched, falls, work)
            longest = min(last + _LANDING / h, 1.0) if final else 1.0
            if found != NOTHING and root <= longest:
                kind, theta = found, min(root, last) if final else root
        if kind == NOTHING and theta == 1:
            times(T.P, s, ahead)
        else:
            within(T.P, T.M, T.D, T.A.shape[1] - 1, s, theta, ahead, spare)
        if kind == NOTHING and wild:
            for j in range(m):
                if not abs(ahead[j]) <= _DIVERGED:
                    kind = _GONE
        until = begin + min((i + k + theta) * h, asked)
        if kind == NOTHING and final:
            until = stop
        _rows_until(T, run, until, begin + (i + k) * h, 0.0, scratch, spare)
        _extend(T, run, ahead, False)
        for j in range(n_y):
            if turning[j]:
                extremes(T.A, T.F, rows - n_y + j, s, theta, run.high, run.low, j, work)
        copy(ahead, s[:m])
        if kind != NOTHING:
            return kind, k, until
        if signals > 0:
            move(s[m:], 1.0, signals)
    return kind, steps, until


@inlined
def _piece(T, run, room, work, turning, scratch, spare, patience):  # type: ignore[no-untyped-def]
    """Go on with the piece under way; what ended it, −1 where there is no room, and how patient to be still."""
    now, counts, s, m = run.now, run.counts, run.s, len(run.row)
    out, sizes, tails = room
    begin, stop, armed = now[Now.BEGIN], now[Now.STOP], counts[Count.ARMED] != 0
    asked, h, q, signals = stop - begin, T.step, T.steps, T.D.shape[1]
    total = max(int(np.ceil(asked / h * (1 - 1e-14))), 1)
    last = min((asked - (total - 1) * h) / h, 1.0)
    span_rows = int(min(q * h / T.interval, 1e9)) + 2
    while counts[Count.STEP] < total:
        i = counts[Count.STEP]
        patience -= 1
        if patience < 0 or counts[Count.ROWS] + span_rows + 2 > len(run.rows_t):
            now[Now.TIME] = begin + i * h
            return -1, patience
        times(T.W, s, out)
        wild, watched, falls, turns = doubtful(T, m, s, out, sizes, tails, armed, run.high, run.low, turning)
        steps = min(q, total - i)
        whole = steps == q and (i + q < total or last == 1)
        if whole and not (watched or falls or turns):
            until = stop if i + q == total else begin + (i + q) * h
            _rows_until(T, run, until, begin + i * h, q / 2, scratch, spare)
            copy(out, s[:m])
            done = q
        else:
            kind, done, until = _steps(
                T, run, i, steps, total, last, (wild, watched, falls), work, turning, scratch, spare
            )
            if kind != NOTHING:
                now[Now.TIME] = until
                return kind, patience
        counts[Count.STEP] = i + done
        if signals > 0:
            turn_waves(T, run.wave)
            expand(T, run.wave, s[m:])
    now[Now.TIME] = stop
    return NOTHING, patience


@inlined
def _apply(jump, run, scratch):  # type: ignore[no-untyped-def]
    times(jump, run.w, scratch[0, : len(run.w)])
    copy(scratch[0], run.w)
    run.counts[Count.AGE] = FRESH


@inlined
def _event(T, run, scratch):  # type: ignore[no-untyped-def]
    """The controller takes up feedback: note it, and do what an event does."""
    now, counts, t = run.now, run.counts, run.now[Now.TIME]
    m, n_y = len(run.row), len(run.high)
    z = run.w[:m]
    if T.interval < np.inf:
        if t > now[Now.ROW]:
            _note_row(run, t, z)
        if abs(counts[Count.NEXT] * T.interval - t) <= _SAME:
            counts[Count.NEXT] += 1
            counts[Count.AGE] = FRESH  # the row of the grid was not taken, so none goes on from it
    event = run.events[counts[Count.EVENTS]]
    event[0] = t
    copy(z, event[1 : 1 + m])
    copy(run.high, event[1 + m : 1 + m + n_y])
    copy(run.low, event[1 + m + n_y :])
    counts[Count.EVENTS] += 1
    _apply(T.J, run, scratch)
    _extend(T, run, z, True)
    now[Now.READY] = t + T.least
    if T.clock < np.inf:
        counts[Count.TICK] += 1
        now[Now.TICK] = counts[Count.TICK] * T.clock
    if T.delay > 0:
        if T.clock == np.inf:
            now[Now.ACTION] = t + T.delay
        elif now[Now.ACTION] == np.inf:
            now[Now.ACTION] = _next_action(T, run)


@compiled
def _simulate(T, run, most_events):  # type: ignore[no-untyped-def]
    now, counts, m, n_y = run.now, run.counts, len(run.row), len(run.high)
    wide, length = T.W.shape[0], max(len(run.s), len(run.w))
    degree, rows = T.A.shape[1] - 1, T.A.shape[0]
    room = (np.empty(wide), np.empty(len(run.s)), np.empty(T.V.shape[0]))
    tall = 2 * degree + 1
    work = Work(np.empty((rows, degree + 1)), np.empty(tall), np.empty((DEEPEST, tall)), np.empty((DEEPEST, 3)))
    turning, scratch, spare = np.zeros(n_y, np.bool_), np.empty((3, length)), np.empty((2, length))
    patience = _PATIENCE
    while counts[Count.STEP] >= 0 or now[Now.TIME] < T.end:
        if counts[Count.STEP] < 0:
            _open(T, run)
        kind, patience = _piece(T, run, room, work, turning, scratch, spare, patience)
        if kind < 0:
            return _MORE
        counts[Count.STEP] = -1
        copy(run.s, run.w[:m])
        if kind == FALL:
            return _STATUS_FELL
        if kind == _GONE:
            return _STATUS_DIVERGED
        _extend(T, run, run.w[:m], False)
        t = now[Now.TIME]
        if t == now[Now.EDGE]:
            edge = 0
            while T.edges[edge] <= t:
                edge += 1
            now[Now.EDGE] = T.edges[edge]
        if kind == NOTHING and t == now[Now.ACTION]:
            _apply(T.G, run, scratch)
            counts[Count.ACTED] += 1
            now[Now.ACTION] = np.inf if T.clock == np.inf else _next_action(T, run)
        if kind == EVENT or t == now[Now.TICK]:
            _event(T, run, scratch)
            if counts[Count.EVENTS] >= most_events:
                return _REACHED
            if counts[Count.EVENTS] == len(run.events):
                return _MORE
    return _ENDED


@cache
def simulator() -> Any:
    """The compiled simulation ``simulate(tables, run, most_events)``, which changes ``run`` and returns a Status."""
    source = contents(Path(__file__).parent)

    @entry
    def simulate(tables, run, most_events):  # type: ignore[no-untyped-def]
        if source == 0:
            return -1
        return _simulate(tables, run, most_events)

    return simulate
