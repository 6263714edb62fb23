"""The flow of the engine, stretch by stretch, under any controller and with any stepping.

Its verbs are those that :mod:`icmj.simulation.native.loop` calls; there stands what comes first at an instant.

On a stretch (:mod:`icmj.simulation.native.taps`) what is read of earlier is a polynomial in time. A controller that
only reads delayed outputs commands one, which is known ahead, so the engine integrates under it as under any other
input. Any other is integrated with the plant, in its control callback: the model holds the matrices of its present
mode, and what delayed readings and signals add to its rates and to its command. Then whether a guard or a face of its
rule is reached is known only afterwards: the stretch is flown, looked at, and flown again as far as the first of them.

What the engine passes of outputs (and states of the controller) on the way is made a polynomial again, which the taps
read later, and in which guards and faces are looked for: through values at nodes, each by a polynomial of degree seven
through the samples around it, with an error of order eight in their spacing. A fall is noticed where a step ends.
Recurring arguments are those of :mod:`icmj.engine.native.state` and :mod:`icmj.simulation.taps`.
"""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from functools import cache
from typing import Any

from icmj.base.instants import ONE_INSTANT
from icmj.base.references import refer
from icmj.base.roots import evaluate
from icmj.engine.block import Slot
from icmj.engine.native.field import flow, forward
from icmj.engine.native.memory import address, bare, compiled, engine_function, entry, exact, merged, sources
from icmj.engine.native.state import (
    FlowData,
    change,
    check_state,
    end,
    fire,
    note,
    note_event,
    note_rough,
    note_row,
)
from icmj.engine.native.steps import save, step
from icmj.engine.schedule import find_next_row
from icmj.engine.stages import Stages
from icmj.simulation.native.loop import ARRIVED, EDGE, SIGNAL, Status, is_due, run_loop
from icmj.simulation.native.loop import sources as sources_of_loop
from icmj.simulation.native.taps import (
    BEFORE,
    FALLS,
    KEPT,
    MEETS,
    READS,
    SMOOTH,
    TURNS,
    act,
    cross,
    cut,
    foresee,
    is_crowded,
    is_over,
    is_sound,
    is_still,
    leave,
    meets,
    open_stretch,
    remember,
    room,
    settle,
    tick,
)
from icmj.simulation.native.waves import add_waves

_RUNNING = int(Status.RUNNING)
_FELL, _DIVERGED, _STALLED = int(Status.FELL), int(Status.DIVERGED), int(Status.STALLED)
_FULL = int(Status.FULL)
_WHOLE = int(Stages.WHOLE)
_BETWEEN, _FLYING, _ENDING = 0, 1, 2  # stretches; within one; at its end
_POINTS = 8  # that a value between samples is taken from
SAMPLES = 8  # of a stretch at least, as many as that takes
_row_after = compiled(find_next_row)
_normalise = engine_function("mj_normalizeQuat", "void(intp, intp)")
_SHORT = 1e-6  # s; what stretches of that length do is straight


@exact
def _get(engine, state):  # type: ignore[no-untyped-def]
    """Copy the engine's state (qpos, qvel, act, and what springs have yielded)."""
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.plastic):
        for i in range(len(part)):
            state[at + i] = part[i]
        at += len(part)


@exact
def _put(engine, state, t):  # type: ignore[no-untyped-def]
    """Move the engine to a state and a time."""
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.plastic):
        for i in range(len(part)):
            part[i] = state[at + i]
        at += len(part)
    engine.time[0] = t


@compiled
def _sample(engine, reader, track, t):  # type: ignore[no-untyped-def]
    """Take a sample of the outputs at the engine's state; where there is no more room, every second one goes."""
    k = track.marks[2]
    if k == len(track.at):
        for i in range(k // 2):
            track.at[i] = track.at[2 * i]
            for j in range(track.y.shape[1]):
                track.y[i, j] = track.y[2 * i, j]
            for j in range(track.states.shape[1]):
                track.states[i, j] = track.states[2 * i, j]
        k //= 2
    track.at[k] = t
    n_y = len(reader.entries)
    for i in range(n_y):
        track.y[k, i] = reader.gain[i] * engine.sensordata[reader.entries[i]] + reader.offset[i]
    for i in range(track.y.shape[1] - n_y):
        track.y[k, n_y + i] = engine.act[engine.first + i]
    row = track.states[k]
    row[0], j = t, 1
    for part in (engine.qpos, engine.qvel, engine.act, engine.sensordata):
        for i in range(len(part)):
            row[j + i] = part[i]
        j += len(part)
    track.marks[2] = k + 1


@compiled
def _choose(track):  # type: ignore[no-untyped-def]
    """The samples to read from, by number into ``track.near``, and how many there are.

    Samples much closer together than the others would magnify rounding.
    """
    count, at, near = track.marks[2], track.at, track.near
    gap, k = 0.05 * (at[count - 1] - at[0]) / max(count - 1, 1), 0
    straight = at[count - 1] - at[0] <= _SHORT
    for i in range(count):
        inside = 0 < i < count - 1
        if not inside or not (straight or at[i] - at[near[k - 1]] <= gap or at[count - 1] - at[i] <= gap):
            near[k] = i
            k += 1
    return k


@compiled
def _between(track, values, count, t, out):  # type: ignore[no-untyped-def]
    """``out`` := the values at ``t``, by the polynomial through the samples around it."""
    at, near, points = track.at, track.near, min(_POINTS, count)
    first = 0
    while first < count - points and at[near[first + points // 2]] < t:
        first += 1
    for i in range(len(out)):
        out[i] = 0.0
    for j in range(points):
        weight, here = 1.0, at[near[first + j]]
        for k in range(points):
            if k != j:
                there = at[near[first + k]]
                weight *= (t - there) / (here - there)
        for i in range(len(out)):
            out[i] += weight * values[near[first + j], i]


@compiled
def _curve(taps, now, track):  # type: ignore[no-untyped-def]
    """The polynomials of the stretch that has been flown, about its begin, into ``track.curves``."""
    t, end, rows = track.t[0], track.t[1], len(track.curves)
    half, count = (end - t) / 2, _choose(track)
    for node in range(len(taps.nodes)):
        _between(track, track.y, count, t + half * (1 + taps.nodes[node]), now.values[node, :rows])
    settle(taps, now.values, (end - t) / taps.unit, track.curves, now.g)


@compiled
def _look(taps, now, reader, track):  # type: ignore[no-untyped-def]
    """Current readings, state and command of the controller on the stretch that has been flown, as polynomials."""
    n_y, mode, direct = len(reader.entries), now.mode[0], taps.direct
    K, S = taps.K[mode], taps.S[mode]
    for j in range(now.v.shape[1]):
        for i in range(len(now.a)):
            now.A[i, j] = track.curves[n_y + i, j]
        for i in range(direct):
            now.v[i, j] = track.curves[i, j]
    add_waves(reader.errors, track.t[0], track.t[1], taps.unit, now.v[:direct])
    for i in range(len(now.u)):
        for j in range(now.u.shape[1]):
            total = 0.0
            for k in range(len(now.a)):
                total -= K[i, k] * now.A[k, j]
            for k in range(len(now.v)):
                total -= S[i, k] * now.v[k, j]
            now.u[i, j] = total


@compiled
def _remember(taps, history, now, reader, track):  # type: ignore[no-untyped-def]
    """Remember what there was to read on the stretch that is over."""
    if len(taps.tau) == 0:
        return
    n_y, rows = len(reader.entries), history.r[remember(history, track.t[0], now.level[0])]
    for i in range(n_y):
        for j in range(rows.shape[1]):
            rows[i, j] = track.curves[i, j]
    add_waves(reader.errors, track.t[0], track.t[1], taps.unit, rows[:n_y])
    for i in range(n_y, len(rows)):  # commands, which it reads, too
        for j in range(rows.shape[1]):
            rows[i, j] = now.u[i - n_y, j]


@compiled
def _install(engine, taps, now, reader):  # type: ignore[no-untyped-def]
    """Put the controller into the model as it is on the stretch: its state, its mode, and what is known ahead."""
    b, mode, size, direct = engine.block, now.mode[0], len(now.a), taps.direct
    powers, own = int(b[Slot.POWERS]), int(b[Slot.SIZE])
    for i in range(size):
        engine.act[engine.first + i] = now.a[i]
    for at, matrix in (
        (int(b[Slot.AT_M]), reader.M[mode]),
        (int(b[Slot.AT_N]), reader.N[mode]),
        (int(b[Slot.AT_K]), reader.K[mode]),
        (int(b[Slot.AT_S]), reader.S[mode]),
    ):
        width = matrix.shape[1]
        for i in range(len(matrix)):
            for j in range(width):
                b[at + i * width + j] = matrix[i, j]
    course, drift = int(b[Slot.AT_COURSE]), int(b[Slot.AT_DRIFT])
    for j in range(powers):
        for i in range(len(now.u)):
            total = 0.0
            for k in range(direct, len(now.v)):
                total -= taps.S[mode, i, k] * now.v[k, j]
            b[course + reader.actuators[i] * powers + j] = reader.b[i] * total
        for i in range(size):
            total = 0.0
            for k in range(direct, len(now.v)):
                total += taps.N[mode, i, k] * now.v[k, j]
            b[drift + i * powers + j] = total
        for i in range(size, own):
            b[drift + i * powers + j] = 0.0


@compiled
def _row_here(engine, plan, progress, record, now, track):  # type: ignore[no-untyped-def]
    """Record a row where the last stretch ended, with the command and the mode that led there, if none is yet."""
    t = engine.time[0]
    if track.t[2] < t:
        note_row(engine, record)
        last = record.count[1] - 1
        for i in range(len(now.last)):
            record.u[last, i] = now.last[i]
        record.mode[last] = now.mode[BEFORE]
        record.count[5], track.t[2] = record.count[1], t
    if progress[0].next_row <= t + ONE_INSTANT:  # this is that row
        progress[0].next_row = _row_after(t, plan.record_interval, plan.breaks)


@compiled
def _start(engine, plan, progress, record, taps, history, now, reader, track):  # type: ignore[no-untyped-def]
    """Begin the stretch from where the engine is: what acts, and what is known of the command."""
    t, level, b, guard = engine.time[0], now.level[0], engine.block, -1
    longest = min(plan.t_end, plan.edges[now.due[EDGE]])
    if reader.joint:
        # so long that its samples and rows find room beside those that are there
        longest = min(longest, t + len(record.dense) // 4 * plan.record_interval)
        level, end = open_stretch(taps, history, now, t, longest, level)
        _install(engine, taps, now, reader)
        _get(engine, track.begin)
    else:
        level, end, guard = foresee(taps, history, now, t, longest, level)
        powers = int(b[Slot.POWERS])
        for i in range(len(now.u)):
            course = int(b[Slot.AT_COURSE]) + reader.actuators[i] * powers
            for j in range(powers):
                b[course + j] = reader.b[i] * now.u[i, j]
    if now.met[READS] != 0 and len(reader.errors.grids) == 0 and t > track.t[2]:  # noise that is read bends everywhere
        _row_here(engine, plan, progress, record, now, track)
        progress[0].next_row, track.marks[6] = t, 1
    track.t[3], track.marks[4], track.marks[5] = progress[0].next_row, record.count[0], record.count[1]
    b[Slot.SINCE], b[Slot.UNIT] = t, taps.unit
    if level < taps.rough and end > t:
        note_rough(record, t)
    track.t[0], track.t[1] = t, end
    now.level[0], track.marks[0], track.marks[1], track.marks[2] = level, guard, _FLYING, 0


@compiled
def _command(taps, now, track, record):  # type: ignore[no-untyped-def]
    """Write down command and mode at the rows that have been recorded since the last call."""
    for row in range(record.count[5], record.count[1]):
        theta = (record.rows[row, 0] - track.t[0]) / taps.unit
        for i in range(len(now.u)):
            record.u[row, i] = evaluate(now.u[i], now.u.shape[1] - 1, theta)
        again = record.rows[row, 0] <= track.t[2] and track.marks[6] != 0
        record.mode[row] = KEPT - now.mode[0] if again else now.mode[0]
        track.t[2] = record.rows[row, 0]
    record.count[5] = record.count[1]


@compiled
def _rows(engine, plan, progress, record, track):  # type: ignore[no-untyped-def]
    """Rows that are due before the stretch's last sample; whether there was room for all of them."""
    count = _choose(track)
    while progress[0].next_row < track.at[track.marks[2] - 1] - ONE_INSTANT:
        if record.count[1] + 2 > len(record.rows):
            return False
        t, row = progress[0].next_row, record.rows[record.count[1]]
        _between(track, track.states, count, t, row)
        if not plan.hinges:
            _normalise(engine.model, address(row[1:]))
        row[0] = t
        record.count[1] += 1
        progress[0].next_row = _row_after(t, plan.record_interval, plan.breaks)
    return True


@compiled
def _turns_back(engine, progress, record, taps, now, track):  # type: ignore[no-untyped-def]
    """Whether a guard or a face is reached within the stretch that was flown; then the engine is at its begin again.

    What was recorded on the way is taken back, and the stretch ends where the first of them is.
    """
    t, end = track.t[0], track.t[1]
    crossing, guard = cut(taps, now, t, end)
    track.marks[0] = guard
    if crossing == end:
        return False
    record.count[0], record.count[1], progress[0].next_row = track.marks[4], track.marks[5], track.t[3]
    track.t[1], track.marks[1], track.marks[2], track.marks[3] = crossing, _FLYING, 0, _RUNNING
    _put(engine, track.begin, t)
    return True


@compiled
def _finish(engine, plan, progress, record, taps, history, now, reader, track, status):  # type: ignore[no-untyped-def]
    """End the stretch where the engine is: what was read, state and command there, the outputs, a row if it ends here.

    Where the plant has fallen the stretch ends, with what is due there still to come.
    """
    t, end = track.t[0], track.t[1]
    track.marks[1], now.met[FALLS] = _BETWEEN, status == _FELL
    if status == _FELL:
        if engine.time[0] < end:  # a guard that it was to end at is not reached
            track.marks[0] = now.met[MEETS] = -1
        track.t[1] = end = engine.time[0]
        status = _RUNNING
    if status == _RUNNING:
        if end > t:
            if not reader.joint:
                _curve(taps, now, track)
            _remember(taps, history, now, reader, track)
            now.level[0] = SMOOTH
        leave(taps, now, (end - t) / taps.unit, track.marks[0])
        if reader.joint:
            for i in range(len(now.a)):
                now.a[i] = engine.act[engine.first + i]
        if not is_sound(now):
            status = _DIVERGED
    if end > t:
        # a row that is due here is of the next stretch, whose command is that from the right
        note(engine, progress, plan, record, False, status != _RUNNING)
        _command(taps, now, track, record)
    return status


@compiled
def _depart(engine, plan, progress, record, reader, track):  # type: ignore[no-untyped-def]
    """The rates where a stretch begins, or begins again, and the row that is due there.

    The command jumps there, or is another polynomial.
    """
    if engine.stages == _WHOLE:
        forward(engine.model, engine.data)
    else:
        flow(engine)
    progress[0].grid, progress[0].steps = engine.time[0], 0
    _sample(engine, reader, track, engine.time[0])
    if progress[0].next_row <= engine.time[0] + ONE_INSTANT and progress[0].next_row < track.t[1] - ONE_INSTANT:
        note_row(engine, record)
        progress[0].next_row = _row_after(engine.time[0], plan.record_interval, plan.breaks)


@merged
def _travel(f):  # type: ignore[no-untyped-def]
    """One stretch, or as much of it as there is room for."""
    engine, plan, progress, record = f.engine, f.plan, f.progress, f.record
    taps, history, now, reader, track = f.taps, f.history, f.now, f.reader, f.track
    time, status = engine.time, _RUNNING
    if track.marks[1] == _BETWEEN:
        progress[0].left -= 1
        if progress[0].left < 0 or time[0] >= f.until:
            return _RUNNING
        if record.count[4] + 4 > len(record.rough) or record.count[1] + 4 > len(record.rows):
            return _RUNNING
        if reader.joint and max(record.count[0], record.count[1]) > len(record.dense) // 4:
            return _RUNNING
        if is_crowded(now) or not room(history):
            return _FULL
        if is_still(now):
            return _STALLED
        if is_due(min(plan.edges[now.due[EDGE]], taps.edges[now.due[SIGNAL]]), time[0]):  # where the run begins
            return ARRIVED
        _start(engine, plan, progress, record, taps, history, now, reader, track)
        if track.t[1] > track.t[0]:
            _depart(engine, plan, progress, record, reader, track)
    t = track.t[0]
    while True:
        end = track.t[1]
        most = plan.timestep if end - t <= _SHORT else min(plan.timestep, (end - t) / SAMPLES)
        while track.marks[1] == _FLYING and time[0] < end:
            if len(record.dense) - max(record.count[0], record.count[1]) < len(record.dense) // 4 + SAMPLES + 4:
                if not reader.joint:
                    return _RUNNING
                track.t[1] = end = time[0]  # what has been flown is a stretch, too
                break
            progress[0].length = end - time[0]
            record.count[3] += 1
            lands = end - time[0] <= most * (1 + 1e-9)
            save(engine)
            progress[0].begin, progress[0].length = time[0], end - time[0] if lands else most
            progress[0].end = end if lands else progress[0].grid + (progress[0].steps + 1) * most
            step(engine, progress, progress[0].length)
            progress[0].steps += 1
            if not reader.joint:
                _command(taps, now, track, record)
            status = check_state(engine, plan)
            if status in (_RUNNING, _FELL):
                _sample(engine, reader, track, time[0])
            if status != _RUNNING or time[0] >= end:
                break
            note(engine, progress, plan, record, False, False)
            if not reader.joint:
                _command(taps, now, track, record)
        if track.marks[1] == _FLYING:
            track.marks[1], track.marks[3] = _ENDING, status
            if reader.joint:
                if end > t and status in (_RUNNING, _FELL):
                    track.marks[0] = track.marks[0] if time[0] == end else -1  # not reached by what fell before
                    track.t[1] = end = time[0]
                    _curve(taps, now, track)
                elif end == t:  # outputs and state where it is are all that there is
                    _sample(engine, reader, track, t)
                    for i in range(len(track.curves)):
                        for j in range(track.curves.shape[1]):
                            track.curves[i, j] = 0.0
                        own = i - len(reader.entries)
                        track.curves[i, 0] = now.a[own] if own >= 0 else track.y[0, i]
                if status in (_RUNNING, _FELL):
                    _look(taps, now, reader, track)
                    # what has been flown again is known to end here
                    if track.marks[0] < 0 and _turns_back(engine, progress, record, taps, now, track):
                        status = _RUNNING
                        _depart(engine, plan, progress, record, reader, track)
                        if track.t[1] > t:
                            continue
                        track.marks[1], end = _ENDING, t
        break
    if end > t and not _rows(engine, plan, progress, record, track):
        return _RUNNING
    _command(taps, now, track, record)
    status = _finish(engine, plan, progress, record, taps, history, now, reader, track, track.marks[3])
    return ARRIVED if status == _RUNNING else status


@exact
def _note(f, event, acted):  # type: ignore[no-untyped-def]
    track, t = f.track, f.time[0]
    turned, planned = event or f.now.met[TURNS] != 0, acted or meets(f.plan.breaks, t)
    if turned or planned or is_over(f) or f.now.met[FALLS] != 0:
        _row_here(f.engine, f.plan, f.progress, f.record, f.now, track)
    if t > 0 and (turned or planned):
        # the next stretch begins with it, whose command is that from the right
        f.progress[0].next_row, track.marks[6] = t, 0 if turned else 1
    if event:
        note_event(f.engine, f.record)
        note_rough(f.record, t)


@compiled
def _run(flow):  # type: ignore[no-untyped-def]
    return run_loop(flow, _travel, change, act, tick, cross, _note, fire, end)


@cache
def compile_stretches() -> Any:
    """The compiled ``march`` of a run by stretches, with what it needs of :class:`FlowData`.

    ``left`` is the number of stretches until the caller is asked, who may have been interrupted.
    """
    source = sources() + sources_of_loop()

    @entry
    def march(engine, plan, progress, record, levels, until, left, taps, history, now, reader, track):  # type: ignore[no-untyped-def]
        progress[0].source, progress[0].left = source, left
        run, here = bare(plan), bare(engine)
        f = FlowData(
            here, run, 0, bare(progress), bare(record), bare(taps), bare(history), bare(now), bare(reader),
            bare(track), bare(levels), until, here.time, run.edges, run.t_end,
        )  # fmt: skip
        return _run(refer(f))

    return march
