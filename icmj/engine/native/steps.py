"""The flow of the engine step by step, under a controller that reads the current outputs alone.

The verbs that :mod:`icmj.simulation.native.loop` calls; there stands what comes first at an instant. With them: one
step of the engine, which can be undone and repeated with another length, and the search for a zero of the event
function in a step. It runs without the GIL and cannot raise: a run that goes wrong comes back as a status.

Each step is taken from a forward pass at its start to one at its end, which gives the outputs and, from the activation
rates, E and dE/dt at both ends. Their Hermite cubic decides whether E may have reached zero in between, to a 64th of
the step (:func:`search`); the event is then located by repeating the step, shortened.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from icmj.base.instants import ONE_INSTANT, one
from icmj.base.references import refer
from icmj.engine.native.field import drive, flow, forward
from icmj.engine.native.memory import (
    address,
    bare,
    compiled,
    engine_function,
    entry,
    exact,
    inlined,
    merged,
    sources,
)
from icmj.engine.native.state import (
    EULER,
    IMPLICIT,
    RESTARTED,
    RK4,
    STALE,
    FlowData,
    change,
    check_state,
    end,
    fire,
    note,
    note_rough,
    note_row,
)
from icmj.engine.schedule import EVENT_TOLERANCE, find_next_row
from icmj.engine.stages import Stages
from icmj.simulation.native.loop import (
    ARRIVED,
    EDGE,
    READY,
    SIGNAL,
    Status,
    await_sample,
    is_watched,
    next_instant,
    run_loop,
)
from icmj.simulation.native.loop import sources as sources_of_loop
from icmj.simulation.native.taps import FALLS, act, tick

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


_euler, _implicit, _mj_step = (engine_function(f"mj_{name}") for name in ("Euler", "implicit", "step"))
_normalize_quat = engine_function("mj_normalizeQuat", "void(intp, intp)")
_runge_kutta = engine_function("mj_RungeKutta", "void(intp, intp, int32)")

_WHOLE = int(Stages.WHOLE)


@exact
def save(engine):  # type: ignore[no-untyped-def]
    """Save the state at the start of a step, and its rates."""
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.warmstart, engine.plastic):
        for i in range(len(part)):
            engine.saved[at + i] = part[i]
        at += len(part)
    keep_rates(engine, engine.k[0])


@exact
def keep_rates(engine, k):  # type: ignore[no-untyped-def]
    """Save the rates of (qpos, qvel, act) at the engine's state; a quaternion is four numbers like any other."""
    at = len(engine.qpos)
    if len(engine.quaternions) == 0:
        for i in range(at):
            k[i] = engine.qvel[i]
    else:
        for i in range(len(engine.scalars)):
            k[engine.scalars[i, 0]] = engine.qvel[engine.scalars[i, 1]]
        for i in range(len(engine.quaternions)):
            q, v = engine.quaternions[i, 0], engine.quaternions[i, 1]
            w, x, y, z = engine.qpos[q], engine.qpos[q + 1], engine.qpos[q + 2], engine.qpos[q + 3]
            a, b, c = engine.qvel[v], engine.qvel[v + 1], engine.qvel[v + 2]
            k[q] = 0.5 * (-x * a - y * b - z * c)
            k[q + 1] = 0.5 * (w * a - z * b + y * c)
            k[q + 2] = 0.5 * (z * a + w * b - x * c)
            k[q + 3] = 0.5 * (-y * a + x * b + w * c)
    for part in (engine.qacc, engine.act_dot):
        for i in range(len(part)):
            k[at + i] = part[i]
        at += len(part)


@exact
def _restore(engine, progress):  # type: ignore[no-untyped-def]
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.warmstart, engine.plastic):
        for i in range(len(part)):
            part[i] = engine.saved[at + i]
        at += len(part)
    engine.time[0] = progress[0].begin


@compiled
def _lean_runge_kutta(engine, progress, length, end):  # type: ignore[no-untyped-def]
    """The classical Runge–Kutta step from the saved state, and the rates at its end.

    For hinges and slides, whose positions move as vectors do, it is mj_RungeKutta: the same operations in the same
    order, but for the time step with which forces are computed. A quaternion is four numbers that move so, too, and are
    then brought back to unit length.
    """
    k, saved = engine.k, engine.saved
    for stage in range(1, 5):
        at = 0
        for part in (engine.qpos, engine.qvel, engine.act):
            for i in range(len(part)):
                j = at + i
                if stage < 3:
                    rate = k[stage - 1, j] * 0.5
                elif stage == 3:
                    rate = k[2, j]
                else:
                    rate = k[0, j] * (1 / 6) + k[1, j] * (1 / 3) + k[2, j] * (1 / 3) + k[3, j] * (1 / 6)
                part[i] = saved[j] + rate * length
            at += len(part)
        if stage == 4:
            for i in range(len(engine.limited)):
                at = engine.limited[i]
                engine.act[at] = min(max(engine.act[at], engine.low[i]), engine.high[i])
            engine.time[0] = end
            if len(engine.quaternions) > 0:
                _normalize_quat(engine.model, address(engine.qpos))
        else:
            engine.time[0] = progress[0].begin + (0.5 * length if stage < 3 else length)
        flow(engine)
        if stage < 4:
            keep_rates(engine, k[stage])


@exact
def undo(engine, progress):  # type: ignore[no-untyped-def]
    """Make the next step start from the saved state; of those of :func:`_lean_runge_kutta` only the solver does not."""
    if not engine.lean or engine.stages == _WHOLE:
        _restore(engine, progress)
    if not engine.lean:
        forward(engine.model, engine.data)


@exact
def step(engine, progress, length):  # type: ignore[no-untyped-def]
    """One step of the length given from the saved state, and the forward pass at its end."""
    # not the sum that the engine keeps: its rounding errors add up over many equal steps
    end = progress[0].end if length == progress[0].length else progress[0].begin + length
    if engine.lean:
        _lean_runge_kutta(engine, progress, length, end)
        return
    engine.timestep[0] = length
    if engine.integrator == RK4:
        _runge_kutta(engine.model, engine.data, 4)
    elif engine.integrator == EULER:
        _euler(engine.model, engine.data)
    elif engine.integrator == IMPLICIT:
        _implicit(engine.model, engine.data)
    else:
        _mj_step(engine.model, engine.data)
    engine.time[0], engine.timestep[0] = end, engine.own
    forward(engine.model, engine.data)


@compiled
def refresh(engine):  # type: ignore[no-untyped-def]
    """Recompute the rates after a change of the controller's state or of a disturbance."""
    if engine.stages == _WHOLE:
        forward(engine.model, engine.data)
    else:
        drive(engine)


_TOLERANCE = EVENT_TOLERANCE
_SPLITS = 64  # finest division of a step in which E is looked at before a near-touch counts as none


@inlined
def evaluate_faces(faces):  # type: ignore[no-untyped-def]
    """Write (E_j, dE_j/dt) of every face at the engine's state, after a forward pass, into ``faces.now``."""
    for face in range(len(faces.now)):
        E, dE = -1.0, 0.0
        for row in range(faces.cuts[face], faces.cuts[face + 1]):
            value, rate = 0.0, 0.0
            for i in range(faces.spans[row, 0], faces.spans[row, 1]):
                value += faces.R[row, i] * faces.a[i]
                rate += faces.R[row, i] * faces.a_rate[i]
            E += value * value
            dE += 2 * value * rate
        faces.now[face, 0], faces.now[face, 1] = E, dE


@inlined
def active(levels):  # type: ignore[no-untyped-def]
    """The face with the largest E_j; −1 where one is not finite, or there is none."""
    best = -1
    for face in range(len(levels)):
        if not np.isfinite(levels[face, 0]):
            return -1
        if best < 0 or levels[face, 0] > levels[best, 0]:
            best = face
    return best


@inlined
def reached(levels):  # type: ignore[no-untyped-def]
    """Whether the event function has reached zero."""
    face = active(levels)
    return face >= 0 and levels[face, 0] >= 0


@inlined
def copy_levels(source, target):  # type: ignore[no-untyped-def]
    """Copy the levels (E_j, dE_j/dt) of one point to another."""
    for face in range(len(source)):
        target[face, 0], target[face, 1] = source[face, 0], source[face, 1]


@inlined
def _may_reach_zero(E_0, dE_0, E_1, dE_1, length, margin):  # type: ignore[no-untyped-def]
    """Whether E, negative at the start, may reach zero *inside* the step and fall again, with E and dE/dt at both ends.

    The cubic Hermite interpolant H(s) = E_0 + dE_0 s + c s² + d s³ stands for E, allowing for ``margin`` of error. Of
    its two stationary points the maximum is where H'' = −2 √disc; the forms of the root below do not cancel.
    """
    c = (3 * (E_1 - E_0) / length - 2 * dE_0 - dE_1) / length
    d = (dE_0 + dE_1 - 2 * (E_1 - E_0) / length) / length**2
    disc = c * c - 3 * d * dE_0
    if disc <= 0:
        return False
    root = np.sqrt(disc)
    if c < 0:
        s = dE_0 / (root - c)
    elif d != 0:
        s = (-c - root) / (3 * d)
    else:
        return False
    if not 0 < s < length:
        return False
    return E_0 + s * (dE_0 + s * (c + s * d)) + margin >= 0


@inlined
def may_reach_zero(before, after, top, length, margin):  # type: ignore[no-untyped-def]
    """Whether any face's E_j may reach zero inside; ``top`` holds the larger |E_j + 1| of the step's ends."""
    for j in range(len(before)):
        if _may_reach_zero(before[j, 0], before[j, 1], after[j, 0], after[j, 1], length, margin * top[j]):
            return True
    return False


@inlined
def margin(rate, length):  # type: ignore[no-untyped-def]
    """How far E_j + 1 may leave its cubic Hermite interpolant within a step, relative to its value at the ends.

    E_j + 1 = |R_j a|² is a sum of exponentials with rates up to twice the loop's, and a Hermite cubic errs by
    h⁴/384 times the fourth derivative; the factor 10 is for what the nonlinear plant adds.
    """
    return 10 * (2 * rate * length) ** 4 / 384


@compiled
def _hermite_root(low, E_l, dE_l, high, E_h, dE_h):  # type: ignore[no-untyped-def]
    """Root of the cubic Hermite interpolant of E between ``low`` (E < 0) and ``high`` (E ≥ 0)."""
    length = high - low
    c = (3 * (E_h - E_l) / length - 2 * dE_l - dE_h) / length
    d = (dE_l + dE_h - 2 * (E_h - E_l) / length) / length**2
    a, b = 0.0, length
    s = length * E_l / (E_l - E_h)
    for _ in range(50):
        value = E_l + s * (dE_l + s * (c + s * d))
        if value >= 0:
            b = s
        else:
            a = s
        slope = dE_l + s * (2 * c + s * 3 * d)
        new = s - value / slope if slope > 0 else -1.0
        if not a < new < b:
            new = (a + b) / 2
        if abs(new - s) <= 1e-15 * length:
            break
        s = new
    return low + max(s, 1e-3 * _TOLERANCE)


@compiled
def locate(engine, progress, faces, low, at_low, high):  # type: ignore[no-untyped-def]
    """Find the root of max E_j between ``low`` (all negative) and ``high`` (where the engine is; one is not).

    Leaves the engine there.
    """
    now = faces.now
    s = np.inf
    for j in range(len(now)):
        if now[j, 0] >= 0:
            s = min(s, _hermite_root(low, at_low[j, 0], at_low[j, 1], high, now[j, 0], now[j, 1]))
    for trial in range(60):
        undo(engine, progress)
        step(engine, progress, s)
        evaluate_faces(faces)
        face = active(now)
        E, dE = now[face, 0], now[face, 1]
        if E >= 0:
            high = s
        else:
            low = s
        newton = s - E / dE if dE > 0 else np.inf
        if abs(newton - s) <= _TOLERANCE or high - low <= _TOLERANCE:
            break
        s = newton if low < newton < high and trial % 8 != 7 else (low + high) / 2


@compiled
def search(engine, progress, faces, rate, length):  # type: ignore[no-untyped-def]
    """Search for an event inside the last step on 2, 4, … equal parts of it; leaves the state there, or at its end."""
    pieces = 2
    while pieces <= _SPLITS:
        s_a = 0.0
        copy_levels(faces.before, faces.left)
        allowed = margin(rate, length / pieces)
        settled = True
        for j in range(1, pieces + 1):
            s_b = length * j / pieces
            undo(engine, progress)
            step(engine, progress, s_b)
            evaluate_faces(faces)
            if faces.now[active(faces.now), 0] >= 0:
                locate(engine, progress, faces, s_a, faces.left, s_b)
                return True
            settled = settled and not may_reach_zero(faces.left, faces.now, faces.top, s_b - s_a, allowed)
            s_a = s_b
            copy_levels(faces.now, faces.left)
        if settled:
            break
        pieces *= 2
    return False


_RUNNING, _FELL = int(Status.RUNNING), int(Status.FELL)
_NEAR = 1e-9  # of a step, within which a row is where the step ends
_row_after = compiled(find_next_row)


@merged
def _fired(engine, progress, faces, rate, length, armed):  # type: ignore[no-untyped-def]
    """Whether an event occurs within the last step; leaves the state at the first event, or at the step's end."""
    evaluate_faces(faces)
    if not armed:
        return False
    face = active(faces.now)
    if face < 0:
        return False
    for j in range(len(faces.now)):
        faces.top[j] = max(abs(faces.before[j, 0] + 1), abs(faces.now[j, 0] + 1))
    if may_reach_zero(faces.before, faces.now, faces.top, length, margin(rate, length)):
        return search(engine, progress, faces, rate, length)
    if faces.now[face, 0] >= 0:
        locate(engine, progress, faces, 0.0, faces.before, length)
        return True
    return False


@exact
def _levels(faces):  # type: ignore[no-untyped-def]
    """Evaluate E and its rate at the engine's state, as the start values of the next step."""
    evaluate_faces(faces)
    copy_levels(faces.now, faces.before)


@compiled
def _rows_within(engine, progress, plan, record, length):  # type: ignore[no-untyped-def]
    """Rows that are due in the step to come, each by a shorter step of its own from where that begins.

    What the step does, and what is sampled, does not depend on them.
    """
    begin, last = progress[0].begin, progress[0].begin + length - _NEAR * plan.timestep
    while progress[0].next_row < last and record.count[1] + 2 < len(record.rows):
        t = progress[0].next_row
        step(engine, progress, t - begin)
        if check_state(engine, plan) != _RUNNING:  # what comes of it is seen where the step ends
            return
        engine.time[0] = t
        note_row(engine, record)
        progress[0].next_row = _row_after(t, plan.record_interval, plan.breaks)


@exact
def _take_back(engine, progress, plan, record, first):  # type: ignore[no-untyped-def]
    """Rows from the number ``first`` on that an event, or its sample, is earlier than, or no later: due once more."""
    while record.count[1] > first and record.rows[record.count[1] - 1, 0] > engine.time[0] - _NEAR * plan.timestep:
        record.count[1] -= 1
        progress[0].next_row = record.rows[record.count[1], 0]


@merged
def _travel(f):  # type: ignore[no-untyped-def]
    """One step, or the part of it until an event."""
    engine, plan, faces, progress, now = f.engine, f.plan, f.faces, f.progress, f.now
    time, has_rule = engine.time, len(faces.now) > 0
    t = time[0]
    if progress[0].left == 0 or len(f.record.rows) - f.record.count[1] < plan.most or t >= f.until:
        return _RUNNING
    progress[0].left -= 1
    if progress[0].stale == STALE:
        refresh(engine)
    if progress[0].stale != 0:
        _levels(faces)
    target = next_instant(f.taps, now, plan.edges[now.due[EDGE]], plan.t_end)
    armed = has_rule and is_watched(now, t)
    if has_rule and not armed:
        target = min(target, one(now.when[READY], target))
    lands = target - t <= plan.timestep * (1 + 1e-9) + ONE_INSTANT
    length = target - t if lands else plan.timestep
    fired, starts = False, progress[0].stale == RESTARTED and armed and reached(faces.now)
    progress[0].stale = 0
    if starts:  # beyond the threshold from the beginning
        length = 0.0
    progress[0].length = length
    if length > 0:
        save(engine)
        progress[0].begin = t
        progress[0].end = target if lands else progress[0].grid + (progress[0].steps + 1) * plan.timestep
        first = f.record.count[1]
        if plan.tolerance > 0:
            _rows_within(engine, progress, plan, f.record, length)
        step(engine, progress, length)
        fired = _fired(engine, progress, faces, plan.rate, length, armed)
        if fired and lands and target - ONE_INSTANT <= time[0] < target:  # where something else is due
            undo(engine, progress)
            step(engine, progress, length)
            evaluate_faces(faces)
        if fired:
            _take_back(engine, progress, plan, f.record, first)
        lands = lands and time[0] >= target
        copy_levels(faces.now, faces.before)
    if fired or lands:
        progress[0].grid, progress[0].steps = time[0], 0
    else:
        progress[0].steps += 1
    status = check_state(engine, plan)
    progress[0].lands, progress[0].met, now.met[FALLS] = lands or starts, fired, status == _FELL
    if status in (_RUNNING, _FELL):
        return ARRIVED
    _record(f, False, True)
    return status


@exact
def _change(f):  # type: ignore[no-untyped-def]
    """Pass the edges that are due; whether an impulse has moved the controller's state."""
    edge, signal = f.now.due[EDGE], f.now.due[SIGNAL]
    change(f)
    if f.now.due[EDGE] > edge:
        f.progress[0].stale = STALE
        note_rough(f.record, f.time[0])
    return f.now.due[SIGNAL] > signal


@exact
def _cross(f, moved):  # type: ignore[no-untyped-def]
    """Whether the event function has reached zero."""
    engine, faces, progress = f.engine, f.faces, f.progress
    if moved:
        refresh(engine)
        _levels(faces)
        progress[0].stale = 0
    fired = progress[0].met != 0 and not moved
    if not fired and progress[0].lands != 0 and len(faces.now) > 0 and is_watched(f.now, engine.time[0]):
        fired = reached(faces.now)
    if fired and not await_sample(f.taps, f.now, engine.time[0]):
        progress[0].stale, fired = STALE, False  # E is above zero, and not watched: levels anew before the next step
    return fired


@exact
def _record(f, event, due):  # type: ignore[no-untyped-def]
    """Record the outputs where a step ends, with a row where one is due."""
    note(f.engine, f.progress, f.plan, f.record, event, due)
    f.record.count[3] += 1


@exact
def _note(f, event, acted):  # type: ignore[no-untyped-def]
    """Record the outputs where a step ends, with a row at events, actions and the end, and where one is due."""
    t, plan = f.time[0], f.plan
    due = t >= plan.t_end or t >= f.progress[0].next_row - 1e-9 * plan.timestep
    _record(f, event, acted or due or f.now.met[FALLS] != 0)
    if acted:
        note_rough(f.record, f.time[0])


@compiled
def _run(flow):  # type: ignore[no-untyped-def]
    return run_loop(flow, _travel, _change, act, tick, _cross, _note, fire, end)


@cache
def compile_steps() -> Any:
    """The compiled ``advance`` of a run step by step, with what it needs of :class:`FlowData`.

    ``left`` is the number of steps until the caller is asked.
    """
    source = sources() + sources_of_loop()

    @entry
    def advance(engine, plan, progress, record, levels, until, left, faces, taps, now):  # type: ignore[no-untyped-def]
        progress[0].source, progress[0].left = source, left
        run, here = bare(plan), bare(engine)
        f = FlowData(
            here, run, bare(faces), bare(progress), bare(record), bare(taps), 0, bare(now), 0, 0,
            bare(levels), until, here.time, run.edges, run.t_end,
        )  # fmt: skip
        return _run(refer(f))

    return advance
