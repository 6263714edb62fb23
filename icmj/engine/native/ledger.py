"""What both loops do beside stepping: see how the plant stands, write down, apply maps, and know what comes next."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import numpy as np
from numba import types

from icmj.engine.native.compilation import inlined
from icmj.engine.native.field import forward
from icmj.engine.native.memory import bare
from icmj.engine.native.state import Engine, Plan, Rule
from icmj.engine.recording import Recording, Status
from icmj.engine.stages import Stages

_differentiate_pos = types.ExternalFunction(
    "mj_differentiatePos", types.void(types.intp, types.intp, types.float64, types.intp, types.intp)
)

# constants that compiled code freezes
_WHOLE = int(Stages.WHOLE)
_RUNNING, _FELL = int(Status.RUNNING), int(Status.FELL)
_DIVERGED, _WARNED = int(Status.DIVERGED), int(Status.WARNED)


@inlined
def standing(engine, plan):  # type: ignore[no-untyped-def]
    """Whether the plant has fallen, or the state is lost."""
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
        _differentiate_pos(
            engine.model, plan.departure.ctypes.data, 1.0, plan.qpos_0.ctypes.data, engine.qpos.ctypes.data
        )
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
    """Write down where the engine is: the outputs, and a row where one is due or an event fires."""
    count = record.count
    row = record.dense[count[0]]
    row[0] = engine.time[0]
    for i in range(len(engine.sensordata)):
        row[1 + i] = engine.sensordata[i]
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
        progress[0].next_row = engine.time[0] + interval
    count[0] += 1


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


@inlined
def next_action(plan, progress):  # type: ignore[no-untyped-def]
    """When the oldest event that has not acted yet will; infinity if there is none."""
    if plan.delay == 0:
        return np.inf
    acted = progress[0].acted
    if np.isfinite(plan.clock):
        if acted >= progress[0].clock:
            return np.inf
        return (acted + plan.ticks) * plan.clock if plan.ticks >= 0 else acted * plan.clock + plan.delay
    return progress[0].last_event + plan.delay if acted <= progress[0].events else np.inf


@inlined
def bare_engine(e):  # type: ignore[no-untyped-def]
    """The engine's views, as arrays without a reference count."""
    return Engine(
        e.model, e.data, e.integrator, bare(e.timestep), bare(e.time), bare(e.qpos), bare(e.qvel), bare(e.act),
        bare(e.sensordata), bare(e.warmstart), bare(e.warnings), bare(e.phase), bare(e.saved),
        e.stages, e.cameras, e.tendons, e.rows_need_forward, bare(e.block), bare(e.ctrl), bare(e.qacc),
        bare(e.qacc_smooth), bare(e.act_dot), bare(e.passive), bare(e.bias), bare(e.force), bare(e.moment),
        bare(e.moment_at), bare(e.gain), bare(e.applied), bare(e.rownnz), bare(e.rowadr), bare(e.column),
        bare(e.value), bare(e.waves), bare(e.k), bare(e.sum), e.first,
    )  # fmt: skip


@inlined
def bare_plan(p):  # type: ignore[no-untyped-def]
    """Likewise."""
    return Plan(
        p.timestep, p.t_end, p.delta_min, p.clock, p.delay, p.ticks, bare(p.edges), bare(p.phases), p.record_interval,
        bare(p.limits), p.rate, p.events, bare(p.qpos_0), bare(p.departure), p.hinges, p.tolerance,
    )  # fmt: skip


@inlined
def bare_rule(r):  # type: ignore[no-untyped-def]
    """Likewise."""
    return Rule(
        bare(r.a), bare(r.a_rate), bare(r.J), bare(r.G), bare(r.R), bare(r.cuts), bare(r.spans), bare(r.scratch),
        bare(r.before), bare(r.left), bare(r.now), bare(r.top),
    )  # fmt: skip


@inlined
def bare_record(r):  # type: ignore[no-untyped-def]
    """Likewise."""
    return Recording(bare(r.dense), bare(r.rows), bare(r.events), bare(r.event_at), bare(r.count))
