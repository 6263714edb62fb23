"""The loop from event to event as one compiled function.

It is :mod:`icmj.engine.reference` statement by statement. It runs without the GIL and cannot raise: a run that goes
wrong comes back as a status.
"""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np
from numba import types

from icmj.base.array import Array
from icmj.engine import reference
from icmj.engine.block import Block, Slot, block_of
from icmj.engine.fault import can_fault, guarded
from icmj.engine.native import structs
from icmj.engine.native.compilation import compiled, entry, inlined, sources
from icmj.engine.native.field import forward
from icmj.engine.native.memory import bare
from icmj.engine.native.search import active, copy, evaluate, locate, margin, may_reach_zero, search
from icmj.engine.native.state import PROGRESS, Engine, Plan, Rule, engine_of, plan_of, progress_at, rule_of
from icmj.engine.native.step import refresh, save, step
from icmj.engine.recording import Recording, Status
from icmj.engine.schedule import Schedule
from icmj.engine.stages import Stages
from icmj.errors import ModelError

_differentiate_pos = types.ExternalFunction(
    "mj_differentiatePos", types.void(types.intp, types.intp, types.float64, types.intp, types.intp)
)

# constants that compiled code freezes
_WHOLE = int(Stages.WHOLE)
_RUNNING, _COMPLETED, _FELL = int(Status.RUNNING), int(Status.COMPLETED), int(Status.FELL)
_DIVERGED, _WARNED, _REACHED = int(Status.DIVERGED), int(Status.WARNED), int(Status.REACHED)


@inlined
def _fired(engine, progress, rule, rate, length, armed):  # type: ignore[no-untyped-def]
    """Whether an event falls within the step just taken; leaves the state at the first, or at the end."""
    evaluate(rule)
    if not armed:
        return False
    face = active(rule.now)
    if face < 0:
        return False
    for j in range(len(rule.now)):
        rule.top[j] = max(abs(rule.before[j, 0] + 1), abs(rule.now[j, 0] + 1))
    if may_reach_zero(rule.before, rule.now, rule.top, length, margin(rate, length)):
        return search(engine, progress, rule, rate, length)
    if rule.now[face, 0] >= 0:
        locate(engine, progress, rule, 0.0, rule.before, length)
        return True
    return False


@inlined
def _status(engine, plan):  # type: ignore[no-untyped-def]
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
            if abs(engine.qpos[i] - plan.qpos_0[i]) > plan.limit:
                return _FELL
    else:
        _differentiate_pos(
            engine.model, plan.departure.ctypes.data, 1.0, plan.qpos_0.ctypes.data, engine.qpos.ctypes.data
        )
        for i in range(len(plan.departure)):
            if abs(plan.departure[i]) > plan.limit:
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
def _record(engine, progress, interval, record, fired, due):  # type: ignore[no-untyped-def]
    count = record.count
    row = record.dense[count[0]]
    row[0] = engine.time[0]
    for i in range(len(engine.sensordata)):
        row[1 + i] = engine.sensordata[i]
    if fired or due:
        if engine.rows_need_forward and engine.stages != _WHOLE:
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
def _apply(map, rule):  # type: ignore[no-untyped-def]
    """a := map a."""
    for i in range(len(rule.a)):
        rule.scratch[i] = 0.0
        for j in range(len(rule.a)):
            if map[i, j] != 0:
                rule.scratch[i] += map[i, j] * rule.a[j]
    for i in range(len(rule.a)):
        rule.a[i] = rule.scratch[i]


@inlined
def _next_action(plan, progress):  # type: ignore[no-untyped-def]
    """When the oldest event that has not acted yet will; infinity if there is none."""
    if plan.delay == 0:
        return np.inf
    acted = progress[0].acted
    if np.isfinite(plan.clock):
        if acted >= progress[0].clock:
            return np.inf
        return (acted + plan.ticks) * plan.clock if plan.ticks >= 0 else acted * plan.clock + plan.delay
    return progress[0].last_event + plan.delay if acted <= progress[0].events else np.inf


@compiled
def _advance(engine, plan, rule, progress, record, steps):  # type: ignore[no-untyped-def]
    time, watched, clocked = engine.time, len(rule.now) > 0, np.isfinite(plan.clock)
    least = max(plan.delta_min, plan.delay)
    armed = progress[0].armed != 0
    status = _RUNNING
    evaluate(rule)
    copy(rule.now, rule.before)
    for _ in range(steps):
        t = time[0]
        arm = progress[0].last_event + least if watched and not armed else np.inf
        clock = progress[0].clock * plan.clock if clocked else np.inf
        edge = plan.edges[progress[0].edge] if progress[0].edge < len(plan.edges) else np.inf
        act = _next_action(plan, progress)
        target = min(plan.t_end, arm, clock, edge, act)
        lands = target - t <= plan.timestep * (1 + 1e-9)
        length = target - t if lands else plan.timestep
        fired = False
        progress[0].length = length
        if length > 0:
            save(engine)
            progress[0].begin = t
            progress[0].end = target if lands else progress[0].grid + (progress[0].steps + 1) * plan.timestep
            step(engine, progress, length, True)
            fired = _fired(engine, progress, rule, plan.rate, length, armed)
            if fired:
                lands = lands and time[0] >= target
            copy(rule.now, rule.before)
        if fired or lands:
            progress[0].grid, progress[0].steps = time[0], 0
        else:
            progress[0].steps += 1
        status = _status(engine, plan)
        acts = status == _RUNNING and lands and time[0] >= act
        if acts:
            _apply(rule.G, rule)
            progress[0].acted += 1
            refresh(engine)
            evaluate(rule)
            copy(rule.now, rule.before)
        if status == _RUNNING and lands:
            # what was planned for this time
            if time[0] >= arm:
                armed = True
                fired = fired or rule.now[active(rule.now), 0] >= 0
            if time[0] >= clock:
                progress[0].clock += 1
                fired = True
            if time[0] >= plan.t_end:
                status = _COMPLETED
        if fired:
            progress[0].events += 1
            if status == _RUNNING and progress[0].events >= plan.events:
                status = _REACHED
        due = acts or status != _RUNNING or time[0] >= progress[0].next_row - 1e-9 * plan.timestep
        _record(engine, progress, plan.record_interval, record, fired, due)
        if fired:
            _apply(rule.J, rule)
            progress[0].last_event = time[0]
            armed = watched and least == 0
        passed = lands and time[0] >= edge
        if passed:
            progress[0].edge += 1
            engine.phase[0] = plan.phases[progress[0].edge]
        if fired or passed:
            refresh(engine)
            evaluate(rule)
            copy(rule.now, rule.before)
        if status != _RUNNING:
            break
    progress[0].armed = 1 if armed else 0
    return status


@inlined
def _bare_engine(e):  # type: ignore[no-untyped-def]
    return Engine(
        e.model, e.data, e.integrator, bare(e.timestep), bare(e.time), bare(e.qpos), bare(e.qvel), bare(e.act),
        bare(e.sensordata), bare(e.warmstart), bare(e.warnings), bare(e.phase), bare(e.saved),
        e.stages, e.cameras, e.tendons, e.rows_need_forward, bare(e.block), bare(e.ctrl), bare(e.qacc),
        bare(e.qacc_smooth), bare(e.act_dot), bare(e.passive), bare(e.bias), bare(e.force), bare(e.moment),
        bare(e.moment_at), bare(e.gain), bare(e.k), bare(e.sum),
    )  # fmt: skip


@inlined
def _bare_plan(p):  # type: ignore[no-untyped-def]
    return Plan(
        p.timestep, p.t_end, p.delta_min, p.clock, p.delay, p.ticks, bare(p.edges), bare(p.phases), p.record_interval,
        p.limit, p.rate, p.events, bare(p.qpos_0), bare(p.departure), p.hinges,
    )  # fmt: skip


@inlined
def _bare_rule(r):  # type: ignore[no-untyped-def]
    return Rule(
        bare(r.a), bare(r.a_rate), bare(r.J), bare(r.G), bare(r.R), bare(r.cuts), bare(r.spans), bare(r.scratch),
        bare(r.before), bare(r.left), bare(r.now), bare(r.top),
    )  # fmt: skip


@inlined
def _bare_record(r):  # type: ignore[no-untyped-def]
    return Recording(bare(r.dense), bare(r.rows), bare(r.events), bare(r.event_at), bare(r.count))


@cache
def _entry() -> Any:
    source = sources()

    @entry
    def advance(engine, plan, rule, progress, record, steps):  # type: ignore[no-untyped-def]
        progress[0].source = source
        return _advance(
            _bare_engine(engine), _bare_plan(plan), _bare_rule(rule), bare(progress), _bare_record(record), steps
        )

    return advance


class NativeLoop:
    """Steps a composed model from event to event in compiled code; see :class:`icmj.engine.reference.ReferenceLoop`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, schedule: Schedule, qpos_0: Array) -> None:
        block = block_of(model)
        assert block is not None
        structs.check(model, data)
        self._model, self._data, self._block, self._schedule = model, data, block, schedule
        phase = block.header[Slot.PHASE : Slot.PHASE + 1]
        plan = plan_of(schedule, qpos_0, model)
        self._progress = np.zeros(1, PROGRESS)
        self._run = engine_of(model, data, phase), plan, rule_of(block, data), self._progress
        self._can_fault = can_fault(model)
        self.begin()
        _verify(data, block)

    def begin(self) -> None:
        """Start, or start anew, from where the data stand, right after an event."""
        progress_at(self._data.time, self._schedule, self._progress)
        self._block.header[Slot.PHASE] = self._schedule.phases[self._schedule.first_edge(self._data.time)]
        mujoco.mj_forward(self._model, self._data)

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, writing into ``record``."""
        advance, arguments = _entry(), (*self._run, record, steps)
        return Status(guarded(lambda: advance(*arguments)) if self._can_fault else advance(*arguments))


def _verify(data: mujoco.MjData, block: Block) -> None:
    """Compare what the installed callbacks have just written with the plain-Python ones.

    Raises:
        ModelError: if they differ: the callbacks are not installed, or the code on disk is not of this version.
    """
    expected = reference.command(block, data), reference.rates(block, data)
    found = data.ctrl[: len(block.ctrl_0)], data.act_dot[block.act]
    for a, b in zip(found, expected, strict=True):
        scale = 1e-9 * (1 + np.abs(b).max() + np.abs(block.M).max() * np.abs(data.act[block.act]).max())
        if not np.all(np.abs(a - b) <= scale):
            raise ModelError(
                "the native callbacks do not compute this controller; delete numba's cache (__pycache__ in "
                "icmj/engine/native, or NUMBA_CACHE_DIR), or set native = false, which runs the plain-Python loop"
            )
