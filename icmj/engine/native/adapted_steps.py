"""The flow of the engine in steps as long as a tolerance allows, under an observer, a hold and an event rule.

The verbs that :mod:`icmj.simulation.native.loop` calls; there stands what comes first at an instant.
"""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.roots import ONE_INSTANT
from icmj.engine import schedule
from icmj.engine.native.adaptive import (
    accept,
    densify,
    error_of,
    error_within,
    event_in,
    get,
    look_within,
    normalise,
    pass_at,
    put,
    rates_at,
    roots,
    stages,
    stepper_of,
)
from icmj.engine.native.fixed_steps import FixedSteps, active, evaluate, reached
from icmj.engine.native.memory import bare, compiled, entry, exact, merged, run_guarded, sources
from icmj.engine.native.state import (
    RESTARTED,
    STALE,
    Engine,
    Plan,
    Rule,
    act,
    change,
    end,
    fire,
    note,
    note_step,
    standing,
    tick,
)
from icmj.engine.schedule import EVENT_TOLERANCE, Recording, Schedule
from icmj.simulation.native.loop import (
    ARRIVED,
    EDGE,
    READY,
    Status,
    await_sample,
    is_watched,
    next_instant,
    run_loop,
)
from icmj.simulation.native.loop import sources as sources_of_loop

# constants that compiled code freezes
_RUNNING, _FELL, _COLLAPSED = int(Status.RUNNING), int(Status.FELL), int(Status.COLLAPSED)
_GROWTH, _SHRINKAGE, _SAFETY = schedule.GROWTH, schedule.SHRINKAGE, schedule.SAFETY
_rounded = compiled(schedule.round_step)
_SHORTEST, _NUDGE, _TOLERANCE = schedule.SHORTEST, schedule.NUDGE, EVENT_TOLERANCE


@compiled
def _samples(engine, plan, stepper, progress, record, t, length, stop):  # type: ignore[no-untyped-def]
    """Sample outputs and rows due within the step; if the plant has fallen, the engine stays at that state.

    A row close to a sample takes its place, except where rows are kept ``apart``.
    """
    spacing, j = stop / stepper.looks, 1  # of a step that an event ends, as many as of a whole one
    margin, near = 1e-9 * length, 0.0 if stepper.apart else 0.25 * spacing
    while True:
        sample, row = j * spacing, progress[0].next_row - t
        if min(sample, row) >= stop - margin:
            return _RUNNING
        due = row <= sample + near
        s = row if due else sample
        if due and s >= stop - margin:
            return _RUNNING
        sampled = s >= sample - near
        if sampled:
            j += 1
        look_within(engine, stepper, s / length, t + s)
        status = standing(engine, plan)
        if status != _RUNNING:
            return status
        note(engine, progress, plan, record, False, due)
        if stepper.apart and not sampled:
            record.count[0] -= 1


@compiled
def _polish(engine, plan, stepper, rule, t, s, length, at):  # type: ignore[no-untyped-def]
    """A separate step to the event, then Newton's iterations until its time has converged; none if it is due ``at``."""
    limit, exactly = _NUDGE / plan.rate, at < np.inf
    stages(engine, stepper, t, s, 1, stepper.last)
    put(engine, stepper.end, at if exactly else t + s)
    normalise(engine, stepper)
    kept = stepper.K[1]  # of the stages only the first is wanted again
    for i in range(len(kept)):
        kept[i] = stepper.K[0, i]
    for _ in range(8):
        engine.time[0] = at if exactly else t + s
        pass_at(engine, stepper)
        evaluate(rule)
        face = active(rule.now)
        if exactly or face < 0 or rule.now[face, 1] <= 0:
            return
        more = -rule.now[face, 0] / rule.now[face, 1]
        if abs(more) <= _TOLERANCE or not 0 < s + more < 2 * length:
            return
        s += more
        if abs(more) > limit:
            for i in range(len(kept)):
                stepper.K[0, i] = kept[i]
            stages(engine, stepper, t, s, 1, stepper.last)
            put(engine, stepper.end, t + s)
            normalise(engine, stepper)
            for i in range(len(kept)):
                kept[i] = stepper.K[0, i]
            continue
        here, room, K = stepper.end, stepper.room, stepper.K
        get(engine, here)
        for i in range(len(here)):
            room[i] = here[i] + more / 2 * K[0, i]
        put(engine, room, t + s - more / 2)
        pass_at(engine, stepper)
        for i in range(len(here)):
            room[i] = here[i] + more * K[0, i]
        put(engine, room, t + s)
        normalise(engine, stepper)
    pass_at(engine, stepper)


@merged
def _fly(engine, plan, rule, stepper, room_for_roots, progress, record, target, arm):  # type: ignore[no-untyped-def]
    """Take one step towards ``target``; return whether an event ends it, and the status.

    The rule is watched from ``arm`` on. Where it is beyond its threshold there, :func:`event_in` answers with a θ below
    zero, and the event is at ``arm`` to the last bit.
    """
    t = engine.time[0]
    get(engine, stepper.start)
    room, step, rejected = target - t, progress[0].next_step, False
    most = len(record.dense) // 4 * plan.record_interval
    while True:
        length = room if step >= room else (room / 2 if step > room / 2 else step)
        length = min(length, most)
        stages(engine, stepper, t, length, 1, stepper.last)
        error = error_of(stepper, length, plan.tolerance)
        if error <= 1:
            stages(engine, stepper, t, length, stepper.last + 1, stepper.rates - 1)
            densify(stepper, length)
            error = max(error, error_within(stepper, plan.tolerance))
        if error <= 1:
            break
        step = _rounded(
            length * (max(_SHRINKAGE, _SAFETY * error**stepper.exponent) if np.isfinite(error) else _SHRINKAGE)
        )
        rejected = True
        if step < _SHORTEST:
            put(engine, stepper.start, t)
            pass_at(engine, stepper)
            return False, _COLLAPSED
    accept(stepper)
    growth = min(_GROWTH, _SAFETY * error**stepper.exponent) if error > 0 else _GROWTH
    proposed = _rounded(length * (min(growth, 1.0) if rejected else growth))
    if progress[0].fresh != 0 and length < room:
        progress[0].first_step = proposed
    progress[0].next_step = proposed if rejected or length == step else max(proposed, step)
    progress[0].fresh = 0
    s, at = np.inf, np.inf
    if arm <= t + length:
        since = max((arm - t) / length, 0.0)
        theta = event_in(room_for_roots, stepper, rule, len(engine.qpos) + len(engine.qvel) + engine.first, since)
        at = arm if theta < 0 else np.inf
        s = arm - t if theta < 0 else theta * length
    met = length == room and room - ONE_INSTANT <= s <= length  # where something else is due, which comes first
    s = np.inf if met else s
    status = _samples(engine, plan, stepper, progress, record, t, length, min(s, length))
    if status != _RUNNING:
        return False, status
    if s <= length:
        _polish(engine, plan, stepper, rule, t, s, length, at)
        return True, _RUNNING
    put(engine, stepper.end, target if length == room else t + length)
    normalise(engine, stepper)
    if length == room or len(stepper.quaternions) > 0:
        pass_at(engine, stepper)
        return met, _RUNNING
    # first same as last: what the engine holds beside is not of this state, and is not read before the next pass
    for i in range(len(stepper.start)):
        stepper.K[0, i] = stepper.K[stepper.last, i]
    for i in range(len(stepper.y)):
        engine.sensordata[i] = stepper.y[i]
    return False, _RUNNING


class Adapted(NamedTuple):
    """All that the flow of adapted steps works on."""

    engine: Engine
    plan: Plan
    rule: Rule
    stepper: Any
    roots: Any
    progress: Any
    record: Recording


@merged
def _travel(f):  # type: ignore[no-untyped-def]
    """One step, or the part of it until an event."""
    engine, plan, rule, stepper, progress, recorded = f.engine, f.plan, f.rule, f.stepper, f.progress, f.record
    time, has_rule = engine.time, len(rule.now) > 0
    t = time[0]
    if progress[0].left == 0 or len(recorded.dense) - recorded.count[0] < len(recorded.dense) // 4 + stepper.looks + 2:
        return _RUNNING
    progress[0].left -= 1
    if progress[0].stale == RESTARTED:  # right after a forward pass
        rates_at(engine, stepper, stepper.K[0])
    elif progress[0].stale == STALE:
        pass_at(engine, stepper)
    target = next_instant(plan, rule, plan.edges[rule.due[EDGE]], plan.t_end)
    starts = False
    if progress[0].stale == RESTARTED and has_rule and is_watched(rule, t):
        evaluate(rule)
        starts = reached(rule.now)  # beyond the threshold from the beginning
    progress[0].stale, progress[0].length = 0, 0.0 if starts else target - t
    fired, status = False, _RUNNING
    if target > t and not starts:
        # what is due where the step ends comes before a look at E at the same instant
        watched_from = rule.when[READY] if has_rule and rule.when[READY] < target - ONE_INSTANT else np.inf
        fired, status = _fly(engine, plan, rule, stepper, f.roots, progress, recorded, target, watched_from)
    progress[0].steps += 1
    status = standing(engine, plan) if status == _RUNNING else status
    progress[0].lands, progress[0].met, progress[0].status = starts or time[0] >= target, fired, status
    if status in (_RUNNING, _FELL):
        return ARRIVED
    note_step(f, False, False)
    return status


@exact
def _cross(f, moved):  # type: ignore[no-untyped-def]
    """Whether the event function has reached zero; after an event steps begin anew."""
    engine, rule, progress, stepper = f.engine, f.rule, f.progress, f.stepper
    if moved:
        pass_at(engine, stepper)
        progress[0].stale = 0
    fired = progress[0].met != 0 and not moved
    if not fired and progress[0].lands != 0 and len(rule.now) > 0 and is_watched(rule, engine.time[0]):
        evaluate(rule)
        fired = reached(rule.now)
    if fired and not await_sample(f.plan, rule, engine.time[0]):
        progress[0].stale, fired = STALE, False  # the next step begins with rates of its own
    return fired


@exact
def _fire(f):  # type: ignore[no-untyped-def]
    """An event, after which steps begin anew."""
    fire(f)
    f.progress[0].next_step, f.progress[0].fresh = f.progress[0].first_step, 1
    for i in range(len(f.stepper.reach)):
        f.stepper.reach[i] = 0.0


@compiled
def _run(flow):  # type: ignore[no-untyped-def]
    return run_loop(flow, _travel, change, act, tick, _cross, note_step, _fire, end)


@cache
def compile_adapted_steps() -> Any:
    """The compiled loop of adapted steps."""
    source = sources() + sources_of_loop()

    @entry
    def advance(engine, plan, rule, progress, stepper, roots, record, steps):  # type: ignore[no-untyped-def]
        progress[0].source = source
        progress[0].left = steps
        flow = Adapted(bare(engine), bare(plan), bare(rule), bare(stepper), bare(roots), bare(progress), bare(record))
        return _run(flow)

    return advance


class AdaptedSteps(FixedSteps):
    """The loop with adaptive step size, which integrates the rates that the engine computes.

    A step ends where something is planned: the run's end, an event of the clock, an action, an edge of a disturbance.
    Events of the rule and recorded rows lie within steps: the first are found on the dense output and reached by a
    step of their own, the others are read from it.
    """

    adaptive = True

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, schedule: Schedule, qpos_0: Array) -> None:
        self._stepper, self._roots = stepper_of(model, qpos_0, schedule.method), roots()
        super().__init__(model, data, schedule, qpos_0)

    @property
    def parts(self) -> tuple[Any, ...]:
        """Engine, plan, rule, progress, stepper, and room for roots, for another loop over them."""
        return *self._run, self._stepper, self._roots

    @property
    def passes(self) -> int:
        """Number of evaluations of the engine's rates."""
        return int(self._stepper.passes[0])

    def look(self, often: int) -> None:
        """Set the smallest number of output samples in every step, of which rows are none."""
        self._stepper = self._stepper._replace(looks=max(self._stepper.looks, often), apart=True)

    def begin(self) -> None:
        """Start or restart from the state in the data, right after an event."""
        super().begin()
        self._stepper.reach[:] = 0.0

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, fewer where the rows of one more might not fit into ``record``."""
        arguments = (*self._run, self._stepper, self._roots, record, steps)
        return Status(run_guarded(compile_adapted_steps(), arguments, self._faulty))
