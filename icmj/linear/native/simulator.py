"""The simulation of the linear plant from event to event, with everything that is recorded on the way.

Between two instants at which something is due (a *piece*) the state follows a matrix exponential, step by step. A step
is dismissed at once if short polynomials with a bound of what they leave out show that it holds no event, no fall, and
no extreme of an output; only the others are looked at with the whole series.

Quiet motion counts its steps from where the piece begins, and disturbed motion from zero: what acts on a step of that
grid does not depend on the state, and has been worked out before (:mod:`icmj.linear.tables`). A piece then begins
and ends within a step. It is followed back to where that step begins, as if it had come from there, so that all steps
are looked at in the same way. After a jump, what has jumped is followed back alone.

What comes first at an instant. A piece ends at the instant at which something is due, and instants are compared as
they are, never as fractions of a step, which are rounded; those within :data:`SAME` of each other are one, because sums
of intervals are rounded, too. What is due at the same instant happens in this order, each on the state that the one
before has left:

1. what acts on the plant begins, bends or ends; a set-point that jumps moves the controller's state;
2. the action that is due: w := G w;
3. the clock ticks, or the event rule has reached its threshold while it is watched: an event, w := J w;
4. the run has fallen, or is over.

A rule that is watched from the instant on at which a piece ends is not watched within that piece: it is judged where
the next one begins, after what happened there. An event within :data:`SAME` of a piece's end is at its end; if the
controller's state jumps there, that next look decides whether there is an event at all.

Every number that decides is a function of the state and of time alone, so neither the rows asked for nor the size of a
buffer changes a bit of the motion.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.compilation import compiled, contents, entry, inlined
from icmj.base.roots import DEEPEST, SAME, one
from icmj.linear.native.motion import (
    EVENT,
    FALL,
    NOTHING,
    add,
    at,
    backward,
    close,
    combine,
    copy,
    dot,
    doubtful,
    extend,
    extremes,
    first_end,
    forward,
    look_up,
    multiply,
    settle,
    times,
    unfold,
)
from icmj.linear.native.state import FRESH, Count, Now, Status, Work

_DIVERGED = 1e12
_ANCHOR = 64  # rows from one to the next, before one is taken from the steps again
_PATIENCE = 20000  # steps before the caller is asked, who may have been interrupted
_GONE = 3  # beside what ends a step: it diverged
_MORE, _ENDED, _REACHED = int(Status.MORE), int(Status.ENDED), int(Status.REACHED)
_STATUS_FELL, _STATUS_DIVERGED = int(Status.FELL), int(Status.DIVERGED)


@inlined
def _new_row(run, t):  # type: ignore[no-untyped-def]
    """Note when a row is; its number in the buffer, for the caller to fill in."""
    k = run.counts[Count.ROWS]
    run.rows_t[k] = run.now[Now.ROW] = t
    run.counts[Count.ROWS] = k + 1
    return k


@inlined
def _rows_until(T, acting, run, until, known, series, f):  # type: ignore[no-untyped-def]
    """Record the rows of the grid before ``until``, of the motion from ``run.s`` where the step begins.

    Of quiet motion a row follows from the last one. Of disturbed motion it follows from the beginning of the step,
    which is one matrix, too, where the rows' grid fits the steps'. Elsewhere it takes the ``series``, of which so many
    terms are ``known``.
    """
    m, counts, cell = len(run.row), run.counts, run.counts[Count.CELL]
    last = np.floor((until - SAME) / T.interval)
    if counts[Count.NEXT] > last:
        return
    quiet, begin = T.powers == 0, run.now[Now.ORIGIN] + cell * T.step
    while counts[Count.NEXT] <= last:
        t = counts[Count.NEXT] * T.interval
        place, row = counts[Count.NEXT] * T.stride - cell * T.places, run.rows_z[_new_row(run, t)]
        if quiet and counts[Count.AGE] < _ANCHOR:
            times(T.Q[0], run.row, row)
            counts[Count.AGE] += 1
        elif not quiet and place == 0 < T.places:
            copy(run.s, row)
        elif not quiet and 0 < place < T.places:
            times(T.Q[place], run.s[:m], row)
            lane, k = (cell - acting.first) % len(acting.f), (cell - acting.first) // len(acting.f)
            add(acting.rows[lane, k, (place - 1) * m : place * m], row)
        else:
            if known == 0:
                if not quiet:
                    look_up(acting, cell, run.s[m:])
                known = unfold(T, run.s, m, 1.0, series, f)
            at(series, known, min(max((t - begin) / T.step, 0.0), 1.0), row)
            counts[Count.AGE] = 0
        if quiet:
            copy(row, run.row)
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
    now[Now.TICK] = one(one(now[Now.TICK], now[Now.EDGE]), T.end)
    now[Now.ACTION] = one(one(one(now[Now.ACTION], now[Now.TICK]), now[Now.EDGE]), T.end)
    now[Now.READY] = one(one(one(now[Now.READY], now[Now.ACTION]), now[Now.EDGE]), T.end)
    now[Now.STOP] = min(now[Now.TICK], now[Now.ACTION], now[Now.EDGE], T.end)
    now[Now.BEGIN] = t
    counts[Count.CELL] = 0
    now[Now.ORIGIN], now[Now.OFFSET] = t, 0.0
    if len(T.lines) > 0:
        multiply(T, run)
    copy(run.w, run.s[: len(run.row)])
    if T.powers > 0:
        place = t / T.step
        cell = np.floor(place + close(place))
        counts[Count.CELL] = int(cell)
        now[Now.ORIGIN] = 0.0
        now[Now.OFFSET] = place - cell if place - cell > close(place) else 0.0


@inlined
def _piece(T, acting, run, room, work, turning, series, scratch, patience):  # type: ignore[no-untyped-def]
    """Go on with the piece under way; what ended it, −1 where the caller is asked, and how patient to be still."""
    now, counts, s, m, n_y = run.now, run.counts, run.s, len(run.row), len(run.high)
    out, sizes, tails, f = room
    origin, begin, stop = now[Now.ORIGIN], now[Now.BEGIN], now[Now.STOP]
    # what is due at the piece's end comes before a rule that is watched from there on
    watching = len(T.cuts) > 1 and now[Now.READY] < stop
    h, signals, rows, ahead = T.step, T.M.shape[1] - m, T.A.shape[0], scratch[1, :m]
    n_pos, most_rows = rows - T.cuts[-1] - n_y, int(min(h / T.interval, 1e9)) + 4
    total, outputs, lanes = (stop - origin) / h, m + n_pos + n_y * (T.coarse + 1), len(acting.f)
    difference = scratch[0, :m]
    last = acting.first + lanes * acting.f.shape[2] if acting.edge == now[Now.EDGE] else -1
    while True:
        cell, offset = counts[Count.CELL], now[Now.OFFSET]
        left, slack = total - cell - offset, close(total)
        if left <= slack:
            break
        patience -= 1
        missing = signals > 0 and not acting.first <= cell < last
        if patience < 0 or missing or counts[Count.ROWS] + most_rows > len(run.rows_t):
            now[Now.TIME] = origin + (cell + offset) * h
            return -1, patience
        whole, final = offset + left >= 1 - slack, offset + left <= 1 + slack
        here = 1.0 if whole else offset + left
        ready = offset if now[Now.READY] <= begin else max(offset, (now[Now.READY] - origin) / h - cell)
        armed = watching and ready < here
        if offset > 0 and counts[Count.ENDED] == cell:
            for j in range(m):
                difference[j] = s[j] - run.ended[j]
            backward(T, difference, m, offset, series, f, ahead)
            copy(run.begun, s[:m])
            add(difference, s)
        elif offset > 0:
            look_up(acting, cell, s[m:])
            backward(T, s, m, offset, series, f, ahead)
        settle(s, sizes)
        points, bounds = (len(out), len(tails)) if armed else (outputs, n_pos + n_y)
        times(T.V, sizes, tails[:bounds])
        add(acting.tails[:bounds], tails)
        combine(T.W_z, s, out[:points])
        if signals > 0:
            lane, k = (cell - acting.first) % lanes, (cell - acting.first) // lanes
            add(acting.moved[lane, k], out)
            add(acting.controls[lane, k, : points - m - n_pos], out[m + n_pos :])
        wild, watched, falls, turns = doubtful(T, m, s, out, tails, armed, offset == 0, run.high, run.low, turning)
        kind, theta = NOTHING, here
        if signals > 0 and (watched or falls or turns or not whole):
            look_up(acting, cell, s[m:])
        if watched or falls:
            kind, theta = first_end(T.A, T.F, T.F2, T.cuts, n_pos, s, watched, falls, offset, ready, work)
            # what comes right after the end of the piece is at its end
            if kind == NOTHING or theta > (min(here + SAME / h, 1.0) if final else here):
                kind, theta = NOTHING, here
            theta = min(theta, here)
        terms = 0
        if whole and kind == NOTHING:
            copy(out, ahead)
        elif signals > 0:
            forward(T, s, m, theta, series, f, ahead)
        else:
            terms = unfold(T, s, m, theta, series, f)
            at(series, terms, theta, ahead)
        if wild:
            for j in range(m):
                if not abs(ahead[j]) <= _DIVERGED:
                    kind = _GONE
        until = min(max(origin + (cell + theta) * h, begin), stop)
        if kind == EVENT and theta == ready and abs(until - now[Now.READY]) <= SAME:
            until = now[Now.READY]
        elif kind == EVENT and theta == ready and until - begin <= SAME:
            until = begin
        if stop - until <= SAME and (final or kind != NOTHING):
            until = stop
        _rows_until(T, acting, run, until, terms, series, f)
        if turns:  # what an output is at either end is looked at anyway
            for j in range(n_y):
                if turning[j]:
                    extremes(T.A, T.F, rows - n_y + j, s, offset, theta, run.high, run.low, j, work)
        if kind != NOTHING or final:
            copy(s, run.begun)
            copy(ahead, run.ended)
            counts[Count.ENDED] = cell
        copy(ahead, s[:m])
        if kind != NOTHING:
            now[Now.TIME] = until
            return kind, patience
        if final:
            break
        counts[Count.CELL], now[Now.OFFSET] = cell + 1, 0.0
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
            copy(z, run.rows_z[_new_row(run, t)])
        if abs(counts[Count.NEXT] * T.interval - t) <= SAME:
            counts[Count.NEXT] += 1
            counts[Count.AGE] = FRESH  # the row of the grid was not taken, so none goes on from it
    event = run.events[counts[Count.EVENTS]]
    event[0] = t
    copy(z, event[1 : 1 + m])
    copy(run.high, event[1 + m : 1 + m + n_y])
    copy(run.low, event[1 + m + n_y :])
    counts[Count.EVENTS] += 1
    _apply(T.J, run, scratch)
    extend(T, run, z, True)
    now[Now.READY] = t + T.wait
    if T.sampling > 0:
        now[Now.TICK] = np.inf
    if T.clock < np.inf:
        counts[Count.TICK] += 1
        now[Now.TICK] = counts[Count.TICK] * T.clock
    if T.delay > 0:
        if T.clock == np.inf:
            now[Now.ACTION] = t + T.delay
        elif now[Now.ACTION] == np.inf:
            now[Now.ACTION] = _next_action(T, run)


@inlined
def _beyond(T, run):  # type: ignore[no-untyped-def]
    """Whether the rule is watched and at or beyond its threshold, at the present state."""
    if not run.now[Now.READY] <= run.now[Now.TIME]:
        return False
    beyond = False
    for face in range(len(T.cuts) - 1):
        square = 0.0
        for row in range(T.cuts[face], T.cuts[face + 1]):
            square += dot(T.A[row, 0], run.w[: len(run.row)]) ** 2
        beyond = beyond or square >= 1
    return beyond


@compiled
def _simulate(T, acting, run, room, work, turning, series, scratch, most_events):  # type: ignore[no-untyped-def]
    now, counts, m, patience = run.now, run.counts, len(run.row), _PATIENCE
    while counts[Count.CELL] >= 0 or now[Now.TIME] < T.end:
        if counts[Count.CELL] < 0:
            _open(T, run)
        kind, patience = _piece(T, acting, run, room, work, turning, series, scratch, patience)
        if kind < 0:
            return _MORE
        counts[Count.CELL] = -1
        copy(run.s, run.w[:m])
        if kind == _GONE:
            return _STATUS_DIVERGED
        extend(T, run, run.w[:m], False)
        t, fallen, may_jump = now[Now.TIME], kind == FALL, False
        if fallen and t < now[Now.STOP]:
            return _STATUS_FELL
        # 1: what acts on the plant, or on the controller
        if t == now[Now.EDGE]:
            edge = 0
            while T.edges[edge] <= t:
                edge += 1
            now[Now.EDGE] = T.edges[edge]
            counts[Count.ENDED] = -1  # from here on, other terms act on that step
            may_jump = T.jumps.shape[1] > 0
            for j in range(T.jumps.shape[1]):
                run.w[j] += T.jumps[edge - 1, j]
        # 2: the action
        if t == now[Now.ACTION]:
            _apply(T.G, run, scratch)
            counts[Count.ACTED] += 1
            now[Now.ACTION] = np.inf if T.clock == np.inf else _next_action(T, run)
            may_jump = True
        # 3: an event. After a jump the next piece judges a crossing anew; at the run's end none begins, so here
        if may_jump and kind == EVENT:
            kind = NOTHING
        if t == T.end and kind != EVENT and _beyond(T, run):
            kind = EVENT
        if kind == EVENT and T.sampling > 0:
            now[Now.TICK], now[Now.READY] = t + T.sampling, np.inf
        elif kind == EVENT or t == now[Now.TICK]:
            _event(T, run, scratch)
            if fallen:
                return _STATUS_FELL
            if counts[Count.EVENTS] >= most_events:
                return _REACHED
            if counts[Count.EVENTS] == len(run.events):
                return _MORE
        # 4: fallen; before the run's end, the next piece finds it again where it begins
        if fallen and t == T.end:
            return _STATUS_FELL
    return _ENDED


@cache
def simulator() -> Any:
    """The compiled ``simulate(tables, acting, run, most_events)``, which changes ``run`` and returns a Status."""
    source = contents(Path(__file__).parent)

    @entry
    def simulate(tables, acting, run, most_events):  # type: ignore[no-untyped-def]
        if source == 0:
            return -1
        m, length, rows, degree = len(run.row), len(run.s), tables.A.shape[0], tables.A.shape[1] - 1
        tall, terms = 2 * degree + 1, max(tables.terms[-1], tables.powers) + 1
        room = np.empty(tables.W.shape[0]), np.empty(m), np.empty(tables.V.shape[0]), np.empty(length - m)
        work = Work(np.empty((rows, degree + 1)), np.empty(tall), np.empty((DEEPEST, tall)), np.empty((DEEPEST, 3)))
        turning, scratch = np.zeros(len(run.high), np.bool_), np.empty((2, max(length, len(run.w))))
        series = np.empty((terms, tables.M.shape[1]))
        return _simulate(tables, acting, run, room, work, turning, series, scratch, most_events)

    return simulate
