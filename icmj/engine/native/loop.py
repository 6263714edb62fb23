"""The loop from event to event as one compiled function.

It is :mod:`icmj.engine.reference` statement by statement. It runs without the GIL and cannot raise: a run that goes
wrong comes back as a status.
"""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from copy import copy as copy_of
from functools import cache
from typing import Any

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import called
from icmj.engine import reference
from icmj.engine.block import Block, Slot, block_of
from icmj.engine.fault import can_fault, guarded
from icmj.engine.native import structs
from icmj.engine.native.compilation import entry, merged, sources
from icmj.engine.native.ledger import apply, bare_engine, bare_plan, bare_record, bare_rule, next_action, note, standing
from icmj.engine.native.memory import bare
from icmj.engine.native.search import active, copy, evaluate, locate, margin, may_reach_zero, search
from icmj.engine.native.state import PROGRESS, engine_of, plan_of, progress_at, rule_of
from icmj.engine.native.step import refresh, save, step
from icmj.engine.recording import Recording, Status
from icmj.engine.schedule import Schedule
from icmj.errors import ModelError

# constants that compiled code freezes
_RUNNING, _COMPLETED, _REACHED = int(Status.RUNNING), int(Status.COMPLETED), int(Status.REACHED)


@merged
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


@merged
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
        act = next_action(plan, progress)
        target = min(plan.t_end, arm, clock, edge, act)
        lands = target - t <= plan.timestep * (1 + 1e-9)
        length = target - t if lands else plan.timestep
        fired = False
        progress[0].length = length
        if length > 0:
            save(engine)
            progress[0].begin = t
            progress[0].end = target if lands else progress[0].grid + (progress[0].steps + 1) * plan.timestep
            step(engine, progress, length)
            fired = _fired(engine, progress, rule, plan.rate, length, armed)
            if fired:
                lands = lands and time[0] >= target
            copy(rule.now, rule.before)
        if fired or lands:
            progress[0].grid, progress[0].steps = time[0], 0
        else:
            progress[0].steps += 1
        status = standing(engine, plan)
        acts = status == _RUNNING and lands and time[0] >= act
        if acts:
            apply(rule.G, rule)
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
        note(engine, progress, plan.record_interval, record, fired, due)
        if fired:
            apply(rule.J, rule)
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
        record.count[3] += 1
        if status != _RUNNING:
            break
    progress[0].armed = 1 if armed else 0
    return status


@cache
def fixed_loop() -> Any:
    """The compiled loop of fixed steps."""
    source = sources()

    @entry
    def advance(engine, plan, rule, progress, record, steps):  # type: ignore[no-untyped-def]
        progress[0].source = source
        return _advance(
            bare_engine(engine), bare_plan(plan), bare_rule(rule), bare(progress), bare_record(record), steps
        )

    return advance


class NativeLoop:
    """Steps a composed model from event to event in compiled code; see :class:`icmj.engine.reference.ReferenceLoop`."""

    adaptive = False

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, schedule: Schedule, qpos_0: Array) -> None:
        block = block_of(model)
        assert block is not None
        structs.check(model, data)
        self._model, self._data, self._block, self._schedule = model, data, block, schedule
        phase = block.header[Slot.PHASE : Slot.PHASE + 1]
        plan = plan_of(schedule, qpos_0, model)
        self._progress = np.zeros(1, PROGRESS)
        self._run = engine_of(model, data, phase, self.adaptive), plan, rule_of(block, data), self._progress
        self._can_fault = can_fault(model)
        self.begin()
        _verify(data, block)

    def rescheduled(self, schedule: Schedule, qpos_0: Array) -> NativeLoop:
        """The same room for runs by another schedule of the same order; for the same thread."""
        twin = copy_of(self)
        engine, _, *room = self._run
        twin._schedule = schedule
        twin._run = engine, plan_of(schedule, qpos_0, self._model), *room  # type: ignore[assignment]
        return twin

    def begin(self) -> None:
        """Start, or start anew, from where the data stand, right after an event."""
        progress_at(self._data.time, self._schedule, self._progress)
        self._block.header[Slot.PHASE] = self._schedule.phases[self._schedule.first_edge(self._data.time)]
        mujoco.mj_forward(self._model, self._data)

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, writing into ``record``."""
        return self._guarded(fixed_loop(), (*self._run, record, steps))

    def _guarded(self, advance: Any, arguments: tuple[Any, ...]) -> Status:
        if self._can_fault:
            return Status(guarded(lambda: called(advance, *arguments)))
        return Status(called(advance, *arguments))


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
