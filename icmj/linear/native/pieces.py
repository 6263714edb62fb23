"""The flow of the linear plant under an observer, a hold and an event rule, in pieces of exact motion.

Its verbs are those that :mod:`icmj.simulation.native.loop` calls; there stands what comes first at an instant.

Between two instants at which something is due (a *piece*) the state follows a matrix exponential, step by step. A step
is dismissed at once if short polynomials with a bound of what they leave out show that it holds no event, no fall, and
no extreme of an output; only the others are looked at with the whole series. A rule that begins to watch at the end of
a piece is not watched within it.

Quiet motion counts its steps from where the piece begins, and disturbed motion from zero: what acts on a step of that
grid does not depend on the state, and has been worked out before (:mod:`icmj.linear.tables`). A piece then begins
and ends within a step. It is followed back to where that step begins, as if it had come from there, so that all steps
are looked at in the same way. After a jump, what has jumped is followed back alone.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import compiled, entry, hash_contents, inlined, merged
from icmj.base.instants import ONE_INSTANT
from icmj.base.references import refer
from icmj.base.roots import DEEPEST
from icmj.linear.native.motion import (
    EVENT,
    FALL,
    FRESH,
    NOTHING,
    Acting,
    Count,
    Now,
    Run,
    Tables,
    Work,
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
from icmj.simulation.native.loop import (
    ARRIVED,
    EDGE,
    READY,
    Status,
    await_sample,
    has_passed,
    is_due,
    is_watched,
    next_event,
    next_instant,
    plan_after,
    run_loop,
    sources,
    take_action,
)

_DIVERGED = 1e12
_ANCHOR = 64  # rows from one to the next, before one is taken from the steps again
_PATIENCE = 20000  # steps before the caller is asked, who may have been interrupted
_GONE = 3  # beside what ends a step: it diverged
_ASKS = -1  # the caller is asked
_RUNNING, _COMPLETED, _REACHED = int(Status.RUNNING), int(Status.COMPLETED), int(Status.REACHED)
_FELL, _STATUS_DIVERGED = int(Status.FELL), int(Status.DIVERGED)


class Pieces(NamedTuple):
    """All that the flow works on.

    Attributes:
        T, acting, run: numbers that stay, what acts on the next steps, and what changes.
        room: of W s, of |s|, of V |s|, and of f.
        work, turning, series, scratch: for roots and extremes; which outputs turn; terms of a series; two states.
        most: number of events to stop after.
    """

    T: Tables
    acting: Acting
    run: Run
    room: tuple[Array, Array, Array, Array]
    work: Work
    turning: np.ndarray
    series: Array
    scratch: Array
    most: int


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
    last = np.floor((until - ONE_INSTANT) / T.interval)
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
def _open(T, run):  # type: ignore[no-untyped-def]
    """Begin a piece where the motion is: until when nothing is due."""
    now, counts, t = run.now, run.counts, run.now[Now.TIME]
    now[Now.STOP] = next_instant(T, run, T.edges[run.due[EDGE]], T.end)
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
def _piece(T, acting, run, room, work, turning, series, scratch):  # type: ignore[no-untyped-def]
    """Go on with the piece under way; what ended it."""
    now, counts, s, m, n_y, ready_at = run.now, run.counts, run.s, len(run.row), len(run.high), run.when[READY]
    out, sizes, tails, f = room
    origin, begin, stop = now[Now.ORIGIN], now[Now.BEGIN], now[Now.STOP]
    # what is due at the piece's end comes before a rule that is watched from there on
    watching = len(T.cuts) > 1 and ready_at < stop - ONE_INSTANT
    h, signals, rows, ahead = T.step, T.M.shape[1] - m, T.A.shape[0], scratch[1, :m]
    n_pos, most_rows = rows - T.cuts[-1] - n_y, int(min(h / T.interval, 1e9)) + 4
    total, outputs, lanes = (stop - origin) / h, m + n_pos + n_y * (T.coarse + 1), len(acting.f)
    difference = scratch[0, :m]
    last = acting.first + lanes * acting.f.shape[2] if acting.edge == T.edges[run.due[EDGE]] else -1
    while True:
        cell, offset = counts[Count.CELL], now[Now.OFFSET]
        left, slack = total - cell - offset, close(total)
        if left <= slack:
            break
        counts[Count.LEFT] -= 1
        missing = signals > 0 and not acting.first <= cell < last
        if counts[Count.LEFT] < 0 or missing or counts[Count.ROWS] + most_rows > len(run.rows_t):
            now[Now.TIME] = origin + (cell + offset) * h
            return _ASKS
        whole, final = offset + left >= 1 - slack, offset + left <= 1 + slack
        here = 1.0 if whole else offset + left
        ready = offset if ready_at <= begin + ONE_INSTANT else max(offset, (ready_at - origin) / h - cell)
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
            if kind == NOTHING or theta > (min(here + ONE_INSTANT / h, 1.0) if final else here):
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
        if kind == EVENT and theta == ready and abs(until - ready_at) <= ONE_INSTANT:
            until = ready_at
        elif kind == EVENT and theta == ready and until - begin <= ONE_INSTANT:
            until = begin
        if stop - until <= ONE_INSTANT and (final or kind != NOTHING):
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
            return kind
        if final:
            break
        counts[Count.CELL], now[Now.OFFSET] = cell + 1, 0.0
    now[Now.TIME] = stop
    return NOTHING


@inlined
def _apply(jump, run, scratch):  # type: ignore[no-untyped-def]
    times(jump, run.w, scratch[0, : len(run.w)])
    copy(scratch[0], run.w)
    run.counts[Count.AGE] = FRESH


@merged
def _travel(f):  # type: ignore[no-untyped-def]
    """To the end of the piece under way, or of the next one."""
    T, run = f.T, f.run
    counts, m = run.counts, len(run.row)
    if counts[Count.EVENTS] == len(run.events) or counts[Count.ROWS] + 2 > len(run.rows_t):
        return _RUNNING
    if counts[Count.CELL] < 0:
        _open(T, run)
    kind = _piece(T, f.acting, run, f.room, f.work, f.turning, f.series, f.scratch)
    if kind == _ASKS:
        return _RUNNING
    counts[Count.CELL], counts[Count.MET] = -1, kind
    copy(run.s, run.w[:m])
    if kind == _GONE:
        return _STATUS_DIVERGED
    extend(T, run, run.w[:m], False)
    return ARRIVED


@inlined
def _change(f):  # type: ignore[no-untyped-def]
    T, run, moved = f.T, f.run, False
    while is_due(T.edges[run.due[EDGE]], run.now[Now.TIME]):
        for j in range(T.jumps.shape[1]):
            run.w[j] += T.jumps[run.due[EDGE], j]
            moved = moved or T.jumps[run.due[EDGE], j] != 0
        run.due[EDGE] += 1
        run.counts[Count.ENDED] = -1  # from here on, other terms act on that step
    return moved


@inlined
def _act(f):  # type: ignore[no-untyped-def]
    acts = take_action(f.run, f.run.now[Now.TIME])
    if acts:
        _apply(f.T.G, f.run, f.scratch)
    return acts


@inlined
def _tick(f):  # type: ignore[no-untyped-def]
    return is_due(next_event(f.T, f.run), f.run.now[Now.TIME])


@inlined
def _cross(f, moved):  # type: ignore[no-untyped-def]
    T, run = f.T, f.run
    t = run.now[Now.TIME]
    reached = run.counts[Count.MET] == EVENT and not moved
    for face in range(len(T.cuts) - 1 if not reached and is_watched(run, t) else 0):
        square = 0.0
        for row in range(T.cuts[face], T.cuts[face + 1]):
            square += dot(T.A[row, 0], run.w[: len(run.row)]) ** 2
        reached = reached or square >= 1
    return reached and await_sample(T, run, t)


@inlined
def _note(f, event, acted):  # type: ignore[no-untyped-def]
    """Record an event, and the row that belongs to it, to an action, or to an edge of what acts."""
    T, run = f.T, f.run
    now, counts, t, m, n_y = run.now, run.counts, run.now[Now.TIME], len(run.row), len(run.high)
    z = run.w[:m]
    if T.interval < np.inf and (event or acted or has_passed(T.edges, run.due[EDGE], t)):
        if t > now[Now.ROW]:
            copy(z, run.rows_z[_new_row(run, t)])
        if abs(counts[Count.NEXT] * T.interval - t) <= ONE_INSTANT:
            counts[Count.NEXT] += 1
            counts[Count.AGE] = FRESH  # the row of the grid was not taken, so none goes on from it
    if not event:
        return
    row = run.events[counts[Count.EVENTS]]
    row[0] = t
    copy(z, row[1 : 1 + m])
    copy(run.high, row[1 + m : 1 + m + n_y])
    copy(run.low, row[1 + m + n_y :])
    counts[Count.EVENTS] += 1


@inlined
def _fire(f):  # type: ignore[no-untyped-def]
    _apply(f.T.J, f.run, f.scratch)
    extend(f.T, f.run, f.run.w[: len(f.run.row)], True)
    plan_after(f.T, f.run, f.run.now[Now.TIME])


@inlined
def _end(f, event):  # type: ignore[no-untyped-def]
    if f.run.counts[Count.MET] == FALL:
        return _FELL
    if event and f.run.counts[Count.EVENTS] >= f.most:
        return _REACHED
    return _COMPLETED if f.run.now[Now.TIME] >= f.T.end else _RUNNING


@compiled
def _run(flow):  # type: ignore[no-untyped-def]
    return run_loop(flow, _travel, _change, _act, _tick, _cross, _note, _fire, _end)


@cache
def compile_pieces() -> Any:
    """The compiled ``simulate(tables, acting, run, most_events)``, which changes ``run`` and returns a Status."""
    source = hash_contents(Path(__file__).parent) + sources()

    @entry
    def simulate(tables, acting, run, most_events):  # type: ignore[no-untyped-def]
        if source == 0:
            return _RUNNING
        m, length, rows, degree = len(run.row), len(run.s), tables.A.shape[0], tables.A.shape[1] - 1
        tall, terms = 2 * degree + 1, max(tables.terms[-1], tables.powers) + 1
        room = np.empty(tables.W.shape[0]), np.empty(m), np.empty(tables.V.shape[0]), np.empty(length - m)
        work = Work(np.empty((rows, degree + 1)), np.empty(tall), np.empty((DEEPEST, tall)), np.empty((DEEPEST, 3)))
        turning, scratch = np.zeros(len(run.high), np.bool_), np.empty((2, max(length, len(run.w))))
        series = np.empty((terms, tables.M.shape[1]))
        run.counts[Count.LEFT] = _PATIENCE
        flow = Pieces(tables, acting, run, room, work, turning, series, scratch, most_events)
        return _run(refer(flow))

    return simulate
