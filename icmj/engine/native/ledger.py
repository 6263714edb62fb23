"""Tasks of both loops besides stepping: check the plant, record rows, apply maps, and find the next due time."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from icmj.base.instant import one
from icmj.engine.block import Slot
from icmj.engine.native.compilation import engine_function, exact, inlined
from icmj.engine.native.field import forward
from icmj.engine.native.memory import address
from icmj.engine.schedule import Status, row_after

_row_after = inlined(row_after)
_differentiate_pos = engine_function("mj_differentiatePos", "void(intp, intp, float64, intp, intp)")

# constants that compiled code freezes
_RUNNING, _FELL, _COMPLETED = int(Status.RUNNING), int(Status.FELL), int(Status.COMPLETED)
_DIVERGED, _WARNED, _REACHED = int(Status.DIVERGED), int(Status.WARNED), int(Status.REACHED)


@inlined
def standing(engine, plan):  # type: ignore[no-untyped-def]
    """Whether the plant has fallen, or the state is not finite."""
    size = 0.0
    for part in (engine.qpos, engine.qvel, engine.act):
        for i in range(len(part)):
            size += abs(part[i])
    if not size < 1e10:  # mjMAXVAL; false for NaN, too
        return _DIVERGED
    for i in range(len(engine.warnings)):
        if engine.warnings[i, 1] != 0:
            return _WARNED
    if plan.hinges:
        for i in range(len(engine.qpos)):
            if abs(engine.qpos[i] - plan.qpos_0[i]) > plan.limits[i]:
                return _FELL
    else:
        _differentiate_pos(engine.model, address(plan.departure), 1.0, address(plan.qpos_0), address(engine.qpos))
        for i in range(len(plan.departure)):
            if abs(plan.departure[i]) > plan.limits[i]:
                return _FELL
    return _RUNNING


@inlined
def _write(engine, row):  # type: ignore[no-untyped-def]
    row[0] = engine.time[0]
    at = 1
    for part in (engine.qpos, engine.qvel, engine.act, engine.sensordata):
        for i in range(len(part)):
            row[at + i] = part[i]
        at += len(part)


@inlined
def note(engine, progress, interval, record, fired, due):  # type: ignore[no-untyped-def]
    """Record the outputs at the engine's state, and a row if one is due or an event fires."""
    count = record.count
    row = record.dense[count[0]]
    row[0] = engine.time[0]
    outputs = 1 + len(engine.sensordata)
    for i in range(outputs - 1):
        row[1 + i] = engine.sensordata[i]
    for i in range(len(row) - outputs):  # of a controller that is read by itself, its state
        row[outputs + i] = engine.act[engine.first + i]
    if fired or due:
        if engine.rows_need_forward:
            forward(engine.model, engine.data)
        if progress[0].length > 0:  # else an event at the very start, whose row is there already
            _write(engine, record.rows[count[1]])
            count[1] += 1
        if fired:
            _write(engine, record.events[count[2]])
            record.event_at[count[2]] = count[0]
            count[2] += 1
        progress[0].next_row = _row_after(engine.time[0], interval)
    count[0] += 1


@inlined
def note_row(engine, record):  # type: ignore[no-untyped-def]
    """Record a row of the engine's state, whose outputs there are already."""
    if engine.rows_need_forward:
        forward(engine.model, engine.data)
    _write(engine, record.rows[record.count[1]])
    record.count[1] += 1


@inlined
def note_again(engine, record, row):  # type: ignore[no-untyped-def]
    """Record an event where the outputs were recorded last, and a ``row`` if there is none yet."""
    if row:
        note_row(engine, record)
    _write(engine, record.events[record.count[2]])
    record.event_at[record.count[2]] = record.count[0] - 1
    record.count[2] += 1


@inlined
def apply(map, rule):  # type: ignore[no-untyped-def]
    """a := map a."""
    for i in range(len(rule.a)):
        rule.scratch[i] = 0.0
        for j in range(len(rule.a)):
            if map[i, j] != 0:
                rule.scratch[i] += map[i, j] * rule.a[j]
    for i in range(len(rule.a)):
        rule.a[i] = rule.scratch[i]


@exact
def jump(engine, rule, edge):  # type: ignore[no-untyped-def]
    """Apply the impulses at this edge to the controller's state if it is reached; return whether there are any."""
    b, found = engine.block, False
    if engine.time[0] < edge:
        return False
    at, n_v = int(b[Slot.AT_ERRORS]), int(b[Slot.N_V])
    for _ in range(int(b[Slot.ERRORS])):
        if b[at + 4] == edge and b[at + 5] == edge:
            found = True
            column = int(b[Slot.AT_N]) + int(b[at])
            for i in range(len(rule.a)):
                rule.a[i] += b[column + i * n_v] * b[at + 1]
        at += 6
    return found


class Planned(NamedTuple):
    """The next times of a schedule [s]; infinite if nothing is due. Those that are one instant are equal.

    ``rule`` is when the event function counts from, ``clock`` when an event comes of itself: that of the clock, or the
    sample for which the rule has reached its threshold; ``action`` when the oldest event acts that has not acted yet.
    """

    rule: float
    clock: float
    edge: float
    action: float


@exact
def planned(plan, progress, watched):  # type: ignore[no-untyped-def]
    """The next due time; ``watched`` says whether there is an event rule."""
    waits, end = not watched or progress[0].sample < np.inf, plan.t_end
    edge = plan.edges[progress[0].edge] if progress[0].edge < len(plan.edges) else np.inf
    clock = one(one(progress[0].clock * plan.clock if np.isfinite(plan.clock) else progress[0].sample, edge), end)
    action = one(one(one(_next_action(plan, progress), clock), edge), end)
    rule = np.inf if waits else progress[0].last_event + max(plan.delta_min, plan.delay)
    return Planned(one(one(one(rule, action), edge), end), clock, edge, action)


@exact
def _next_action(plan, progress):  # type: ignore[no-untyped-def]
    # to the last bit what Schedule.clock_action says, by which extremes are cut: product and sum are not fused
    if plan.delay == 0:
        return np.inf
    acted = progress[0].acted
    if np.isfinite(plan.clock):
        if acted >= progress[0].clock:
            return np.inf
        return (acted + plan.ticks) * plan.clock if plan.ticks >= 0 else acted * plan.clock + plan.delay
    return progress[0].last_event + plan.delay if acted <= progress[0].events else np.inf


@exact
def conclude(engine, plan, progress, rule, record, due, lands, acts, fired, status):  # type: ignore[no-untyped-def]
    """Handle what is due at the end of a step: clock, end of run (if the step ``lands`` on them), row, reset, edge.

    ``due`` is what was planned; ``acts`` whether an event has just acted, ``fired`` whether the rule has. Where the
    sample is taken later, the rule only sets its time.

    Returns:
        whether there is an event; whether the rates have jumped since; the status.
    """
    time = engine.time[0]
    crossed = fired and plan.sampling > 0
    if crossed:
        progress[0].sample = time + plan.sampling
        fired = False
    if status == _RUNNING and lands:
        if time >= due.clock:
            progress[0].clock += 1
            progress[0].sample = np.inf
            fired = True
        if time >= plan.t_end:
            status = _COMPLETED
    if fired:
        progress[0].events += 1
        if status == _RUNNING and progress[0].events >= plan.events:
            status = _REACHED
    wanted = acts or status != _RUNNING or time >= progress[0].next_row - 1e-9 * plan.timestep
    note(engine, progress, plan.record_interval, record, fired, wanted)
    record.count[3] += 1
    if fired:
        apply(rule.J, rule)
        progress[0].last_event = time
    passed = lands and time >= due.edge
    if passed:
        progress[0].edge += 1
        engine.phase[0] = plan.phases[progress[0].edge]
    return fired, fired or passed or crossed, status
