"""The loop from event to event as one compiled function.

It runs without the GIL and cannot raise: a run that goes wrong comes back as a status.
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
from icmj.base.environment import SWITCH
from icmj.engine.block import Block, Slot, block_of
from icmj.engine.fault import can_fault
from icmj.engine.native.adaptive import stepper_of
from icmj.engine.native.compilation import entry, exact, merged, run_guarded, sources
from icmj.engine.native.ledger import apply, conclude, jump, planned, standing
from icmj.engine.native.memory import bare
from icmj.engine.native.roots import roots
from icmj.engine.native.search import active, copy, evaluate, locate, margin, may_reach_zero, reached, search
from icmj.engine.native.state import engine_of, new_progress, plan_of, progress_at, rule_of
from icmj.engine.native.step import refresh, save, step
from icmj.engine.schedule import Recording, Schedule, Status
from icmj.engine.tableau import tableau
from icmj.errors import ModelError

_RUNNING = int(Status.RUNNING)


@merged
def _fired(engine, progress, rule, rate, length, armed):  # type: ignore[no-untyped-def]
    """Whether an event occurs within the last step; leaves the state at the first event, or at the step's end."""
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


@exact
def _levels(rule):  # type: ignore[no-untyped-def]
    """Evaluate E and its rate at the engine's state, as the start values of the next step."""
    evaluate(rule)
    copy(rule.now, rule.before)


@merged
def _advance(engine, plan, rule, progress, record, steps):  # type: ignore[no-untyped-def]
    time, watched = engine.time, len(rule.now) > 0
    armed = progress[0].armed != 0
    status = _RUNNING
    _levels(rule)
    for _ in range(steps):
        t = time[0]
        due = planned(plan, progress, watched)
        arm = np.inf if armed else due.rule
        target = min(plan.t_end, arm, due.clock, due.edge, due.action)
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
            lands = lands and time[0] >= target
            copy(rule.now, rule.before)
        if fired or lands:
            progress[0].grid, progress[0].steps = time[0], 0
        else:
            progress[0].steps += 1
        status = standing(engine, plan)
        moved = status == _RUNNING and lands and jump(engine, rule, due.edge)
        acts = status == _RUNNING and lands and time[0] >= due.action
        if acts:
            apply(rule.G, rule)
            progress[0].acted += 1
        if acts or moved:
            refresh(engine)
            _levels(rule)
        if status == _RUNNING and lands and (time[0] >= arm or (armed and moved)):
            armed = True
            fired = fired or reached(rule.now)
        fired, jumped, status = conclude(engine, plan, progress, rule, record, due, lands, acts, fired, status)
        if fired:
            armed = watched and max(plan.delta_min, plan.delay) == 0
        if progress[0].sample < np.inf:
            armed = False
        if jumped:
            refresh(engine)
            _levels(rule)
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
        return _advance(bare(engine), bare(plan), bare(rule), bare(progress), bare(record), steps)

    return advance


class FixedLoop:
    """Steps a composed model from event to event, by the timestep of its schedule.

    Each step is taken from a forward pass at its start to one at its end, which gives the outputs and, from the
    activation rates, E and dE/dt at both ends. Their Hermite cubic decides whether E may have reached zero in
    between, however shortly; the event is then located by repeating the step, shortened.
    """

    adaptive = False

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, schedule: Schedule, qpos_0: Array) -> None:
        """Allocate the work arrays, and start.

        Raises:
            ModelError: if compiled code cannot work on this MuJoCo, or the callbacks are not of this code.
        """
        block = block_of(model)
        assert block is not None
        self._model, self._data, self._block, self._schedule = model, data, block, schedule
        phase = block.header[Slot.PHASE : Slot.PHASE + 1]
        plan = plan_of(schedule, qpos_0, model)
        self._progress = new_progress()
        self._run = engine_of(model, data, phase, self.adaptive), plan, rule_of(block, data), self._progress
        self._faulty = can_fault(model)
        self.begin()
        _verify(data, block)

    def rescheduled(self, schedule: Schedule, qpos_0: Array) -> FixedLoop:
        """The same loop, work arrays included, with another schedule of the same order; for the same thread."""
        other = copy_of(self)
        engine, _, *room = self._run
        other._schedule = schedule
        other._run = engine, plan_of(schedule, qpos_0, self._model), *room
        return other

    @property
    def parts(self) -> tuple[Any, ...]:
        """Engine, plan, rule, progress, and what adapted steps need, for another loop over them."""
        return *self._run, stepper_of(self._model, self._run[1].qpos_0, tableau(8)), roots()

    @property
    def faulty(self) -> bool:
        """Whether MuJoCo may give up."""
        return self._faulty

    def begin(self) -> None:
        """Start or restart from the state in the data, right after an event."""
        progress_at(self._data.time, self._schedule, self._progress)
        self._block.header[Slot.PHASE] = self._schedule.phases[self._schedule.first_edge(self._data.time)]
        mujoco.mj_forward(self._model, self._data)

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, writing into ``record``.

        Raises:
            EngineFault, mujoco.FatalError: if MuJoCo gives up.
        """
        return Status(run_guarded(fixed_loop(), (*self._run, record, steps), self._faulty))


def _verify(data: mujoco.MjData, block: Block) -> None:
    """Compare the values that the installed callbacks have just written with the matrix equations that they implement.

    Raises:
        ModelError: if they differ: the callbacks are not installed, or the code on disk is not of this version.
    """

    def waves(terms: Array, signals: Array, count: int) -> Array:
        at, amplitude, omega, phi, start, end = terms.T
        open_ = (start <= block.header[Slot.PHASE]) & (block.header[Slot.PHASE] < end)
        found = np.bincount(at.astype(int), open_ * amplitude * np.cos(omega * data.time + phi), count).astype(float)
        for place, begin, _, first, last, interval in signals[signals[:, 3] < 0]:
            values = block.values[-1 - int(first) : int(last)]
            if begin <= block.header[Slot.PHASE]:
                found[int(place)] += np.interp(data.time, interval * np.arange(len(values)), values)
        return found

    commanded, read = (int(block.header[slot]) for slot in (Slot.COMMANDED, Slot.READ))
    a, y = data.act[block.act], data.sensordata[: len(block.y_0)]
    beside = waves(block.terms, block.signals[:commanded], len(block.ctrl_0))
    shared = block.signals[len(block.signals) - int(block.header[Slot.SHARES]) :]
    shares = waves(block.terms[:0], shared, len(block.ctrl_0))
    v = waves(block.errors, block.signals[commanded : commanded + read], block.N.shape[1])
    v[: len(y)] += y - block.y_0
    command = block.ctrl_0 - block.K @ a * (1 + shares) + beside
    if len(block.S):
        command = command - block.S @ v[: len(y)]
    rates = block.M @ a + block.N @ v
    for found, expected in ((data.ctrl[: len(command)], command), (data.act_dot[block.act], rates)):
        scale = 1e-9 * (1 + np.abs(expected).max() + np.abs(block.M).max() * np.abs(a).max())
        if not np.all(np.abs(found - expected) <= scale):
            raise ModelError(
                "the compiled callbacks do not compute this controller; delete numba's cache (__pycache__ in "
                f"icmj/engine/native, or NUMBA_CACHE_DIR), or {SWITCH}"
            )
