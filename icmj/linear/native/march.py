"""The simulation from event to event, with everything that is recorded on the way.

A *span* of several steps is dismissed at once if short polynomials with a bound of what they leave out show that it
holds no event, no fall, and no extreme of an output; only the others are gone through step by step, with the whole
series, as :mod:`icmj.linear.watch` does with all of them.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.compilation import compiled, contents, entry
from icmj.linear.native.motion import copy, dot, flow_of, times, within
from icmj.linear.native.polynomial import DEEPEST
from icmj.linear.native.search import EVENT, FALL, NOTHING, doubtful, extremes, first_end
from icmj.linear.native.state import FRESH, NOW, Count, Fact, Now, Size, Status, Work

_DIVERGED = 1e12
_LANDING = 1e-12  # an event this close after the end of a piece [s] is at its end
_SAME = 1e-12  # a recording instant this close to an event [s] is the event
_TICK = 1e-9  # relative: an action this close to a tick of the clock is at it
_ANCHOR = 64  # rows from one to the next, before one is taken from the steps again
_PATIENCE = 20000  # spans before the caller is asked, who may have been interrupted
_GONE = 3  # beside what ends a step: it diverged
_MORE, _ENDED, _REACHED = int(Status.MORE), int(Status.ENDED), int(Status.REACHED)
_STATUS_FELL, _STATUS_DIVERGED = int(Status.FELL), int(Status.DIVERGED)


@compiled
def _row(rows_t, rows_z, counts, now, t, z):  # type: ignore[no-untyped-def]
    k = counts[Count.ROWS]
    rows_t[k] = t
    copy(z, rows_z[k])
    counts[Count.ROWS] = k + 1
    now[Now.ROW] = t


@compiled
def _rows_until(flow, until, start, h, interval, z, row_z, result, spare, rows_t, rows_z, counts, now):  # type: ignore[no-untyped-def]
    """Record the rows of the grid before ``until``, of the motion from ``z`` at ``start``."""
    last = np.floor((until - _SAME) / interval)
    while counts[Count.NEXT] <= last:
        t = counts[Count.NEXT] * interval
        ahead = result[: len(z)]
        if counts[Count.AGE] < _ANCHOR:
            times(flow.Q, row_z, ahead)
            counts[Count.AGE] += 1
        else:
            within(flow, z, (t - start) / h, ahead, spare)
            counts[Count.AGE] = 0
        copy(ahead, row_z)
        _row(rows_t, rows_z, counts, now, t, row_z)
        counts[Count.NEXT] += 1


@compiled
def _march(sizes, cuts, plan, now, counts, rows_t, rows_z, events, most_events):  # type: ignore[no-untyped-def]
    m, n, n_hat = sizes[Size.STATES], sizes[Size.PLANT], sizes[Size.MODEL]
    r, n_faces, n_pos, n_y = sizes[Size.FACE_ROWS], sizes[Size.FACES], sizes[Size.POSITIONS], sizes[Size.OUTPUTS]
    degree, coarse, q = sizes[Size.DEGREE], sizes[Size.COARSE], sizes[Size.STEPS]
    n_rows, controls, bounds = r + n_pos + n_y, (r + n_y) * (coarse + 1), r + n_y + n_pos
    flow = flow_of(plan, m, n_hat, m + controls + n_pos, bounds, n_rows, degree)
    h, end, interval, clock = plan[Fact.STEP], plan[Fact.END], plan[Fact.INTERVAL], plan[Fact.CLOCK]
    least, delay, delayed = plan[Fact.LEAST], plan[Fact.DELAY], sizes[Size.DELAYED] != 0
    z = now[NOW : NOW + m]
    row_z = now[NOW + m : NOW + 2 * m]
    pending = now[NOW + 2 * m : NOW + 2 * m + n_hat]
    high, low = now[NOW + 2 * m + n_hat :][:n_y], now[NOW + 2 * m + n_hat + n_y :][:n_y]
    out, sizes_of, tails = np.empty(m + controls + n_pos), np.empty(m), np.empty(bounds)
    ahead, spare, held = np.empty(m), np.empty((2, m)), np.empty(n_hat)
    tall = 2 * degree + 1
    work = Work(np.empty((n_rows, degree + 1)), np.empty(tall), np.empty((DEEPEST, tall)), np.empty((DEEPEST, 3)))
    turning = np.zeros(n_y, np.bool_)
    patience = _PATIENCE
    span_rows = int(min(q * h / interval, 1e9)) + 2

    while now[Now.TIME] < end:
        t_0 = now[Now.TIME]
        armed = n_faces > 0 and t_0 >= now[Now.READY]
        due = min(now[Now.TICK], now[Now.ACTION])
        if n_faces > 0 and not armed:
            due = min(due, now[Now.READY])
        stop = min(due, end)
        asked = stop - t_0
        total = max(int(np.ceil(asked / h * (1 - 1e-14))), 1)
        last = min((asked - (total - 1) * h) / h, 1.0)
        i, kind = 0, NOTHING
        while i < total:
            patience -= 1
            if patience < 0 or counts[Count.ROWS] + span_rows + 2 > len(rows_t):
                now[Now.TIME] = t_0 + i * h
                return _MORE
            # the span at once
            times(flow.W, z, out)
            wild, watched, falls, turns = doubtful(
                flow, cuts, r, coarse, z, out, sizes_of, tails, armed, high, low, turning
            )
            steps = min(q, total - i)
            whole = steps == q and (i + q < total or last == 1)
            if whole and not (watched or falls or turns):
                until = stop if i + q == total else t_0 + (i + q) * h
                _rows_until(flow, until, t_0 + i * h, h, interval, z, row_z, ahead, spare, rows_t, rows_z, counts, now)
                copy(out, z)
                i += q
                continue
            # its steps one by one
            for _ in range(steps):
                theta = last if i == total - 1 else 1.0
                if watched or falls:
                    found, root = first_end(flow, cuts, r, n_pos, z, watched, falls, work)
                    longest = min(last + _LANDING / h, 1.0) if i == total - 1 else 1.0
                    if found != NOTHING and root <= longest:
                        kind, theta = found, min(root, last) if i == total - 1 else root
                if kind == NOTHING and theta == 1:
                    times(flow.P, z, ahead)
                else:
                    within(flow, z, theta, ahead, spare)
                if kind == NOTHING and wild:
                    for k in range(m):
                        if not abs(ahead[k]) <= _DIVERGED:
                            kind = _GONE
                until = t_0 + min((i + theta) * h, asked)
                if kind == NOTHING and i == total - 1:
                    until = stop
                _rows_until(flow, until, t_0 + i * h, h, interval, z, row_z, out, spare, rows_t, rows_z, counts, now)
                for k in range(n_y):
                    y = dot(flow.A[r + n_pos + k, 0], ahead)
                    high[k], low[k] = max(high[k], y), min(low[k], y)
                    if turning[k]:
                        extremes(flow, r + n_pos + k, z, theta, high, low, k, work)
                copy(ahead, z)
                if kind != NOTHING:
                    break
                i += 1
            if kind != NOTHING:
                break
        now[Now.TIME] = stop if kind == NOTHING else until
        if kind == FALL:
            return _STATUS_FELL
        if kind == _GONE:
            return _STATUS_DIVERGED
        t = now[Now.TIME]
        for k in range(n_y):
            y = dot(flow.A[r + n_pos + k, 0], z)
            high[k], low[k] = max(high[k], y), min(low[k], y)
        if kind == NOTHING and t == now[Now.ACTION]:
            # x_h := the prediction
            times(flow.O, z, held)
            for k in range(n_hat):
                z[n + n_hat + k] = pending[k] - held[k]
            now[Now.ACTION] = np.inf
            counts[Count.AGE] = FRESH
        if kind != EVENT and t != now[Now.TICK]:
            continue
        # the controller takes up feedback
        if interval < np.inf:
            if t > now[Now.ROW]:
                _row(rows_t, rows_z, counts, now, t, z)
            if abs(counts[Count.NEXT] * interval - t) <= _SAME:
                counts[Count.NEXT] += 1
                counts[Count.AGE] = FRESH  # the row of the grid was not taken, so none goes on from it
        k = counts[Count.EVENTS]
        events[k, 0] = t
        copy(z, events[k, 1 : 1 + m])
        copy(high, events[k, 1 + m : 1 + m + n_y])
        copy(low, events[k, 1 + m + n_y :])
        counts[Count.EVENTS] = k + 1
        if delayed:
            times(flow.X, z, pending)
            at_action = t + delay
            if clock < np.inf and abs(at_action / clock - np.round(at_action / clock)) < _TICK:
                at_action = np.round(at_action / clock) * clock
            now[Now.ACTION] = at_action
        else:
            for k in range(n_hat):
                z[n + n_hat + k] = 0
            counts[Count.AGE] = FRESH
        for k in range(n_y):
            high[k] = low[k] = dot(flow.A[r + n_pos + k, 0], z)
        now[Now.READY] = t + least
        if clock < np.inf:
            now[Now.TICK] = (np.floor(t / clock * (1 + 1e-12)) + 1) * clock
        if counts[Count.EVENTS] >= most_events:
            return _REACHED
        if counts[Count.EVENTS] == len(events):
            return _MORE
    return _ENDED


@cache
def march() -> Any:
    """The compiled simulation: ``march(sizes, cuts, plan, now, counts, rows_t, rows_z, events, most_events)``.

    It changes ``now`` and ``counts``, fills the buffers from where the counts say, and returns a :class:`Status`.
    """
    source = contents(Path(__file__).parent)

    @entry
    def run(sizes, cuts, plan, now, counts, rows_t, rows_z, events, most_events):  # type: ignore[no-untyped-def]
        if source == 0:
            return -1
        return _march(sizes, cuts, plan, now, counts, rows_t, rows_z, events, most_events)

    return run
