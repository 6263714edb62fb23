"""The event loop as one compiled function.

It is :mod:`icmj.engine.reference` statement by statement. It runs without the GIL and cannot raise: a run that goes
wrong comes back as a status.
"""

# numba rewrites signatures of intrinsics and calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import ctypes
from collections import namedtuple
from typing import Any

import mujoco
import numpy as np
from numba import types

from icmj.engine import composition, reference, structs
from icmj.engine.compilation import compiled, inlined, load_engine
from icmj.engine.composition import Block, Slot, block_of
from icmj.engine.recording import Recording, Status
from icmj.engine.schedule import EVENT_TOLERANCE, Schedule
from icmj.errors import ModelError
from icmj.linear_plant import Array

load_engine()

# pointers travel as integers of their size: the same registers, and no type to convert
_m_d = types.void(types.intp, types.intp)
_forward = types.ExternalFunction("mj_forward", _m_d)
_euler = types.ExternalFunction("mj_Euler", _m_d)
_implicit = types.ExternalFunction("mj_implicit", _m_d)
_mj_step = types.ExternalFunction("mj_step", _m_d)
_runge_kutta = types.ExternalFunction("mj_RungeKutta", types.void(types.intp, types.intp, types.int32))
_differentiate_pos = types.ExternalFunction(
    "mj_differentiatePos", types.void(types.intp, types.intp, types.float64, types.intp, types.intp)
)

# constants that compiled code freezes
_EVENT, _CLOCK = composition.EVENT, composition.CLOCK
_RUNNING, _COMPLETED, _FELL = int(Status.RUNNING), int(Status.COMPLETED), int(Status.FELL)
_DIVERGED, _WARNED = int(Status.DIVERGED), int(Status.WARNED)
_TOLERANCE, _SPLITS = EVENT_TOLERANCE, reference.SPLITS
_RK4, _EULER, _IMPLICIT, _STEP = 0, 1, 2, 3
_INTEGRATORS = {
    int(mujoco.mjtIntegrator.mjINT_RK4): _RK4,
    int(mujoco.mjtIntegrator.mjINT_EULER): _EULER,
    int(mujoco.mjtIntegrator.mjINT_IMPLICIT): _IMPLICIT,
    int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST): _IMPLICIT,
    int(mujoco.mjtIntegrator.mjINT_DISCRETE): _STEP,
}

# What the compiled loop works on. Arrays are views of the engine's memory or the loop's own state; scalars that change
# are arrays of one. ``clocks`` is (grid, last event, next record, step begin, step end, step length); ``counters`` is
# (steps done on the grid, armed, next clock sample, next edge).
Run = namedtuple(
    "Run",
    "model data integrator trigger n_hat timestep time phase qpos qvel act act_dot sensordata warmstart warnings "
    "a a_rate Q_t q2 h t_end delta_min clock edges phases record_interval limit rate qpos_0 departure hinges "
    "saved clocks counters",
)


@inlined
def _save(run):  # type: ignore[no-untyped-def]
    at = 0
    for part in (run.qpos, run.qvel, run.act, run.warmstart):
        for i in range(len(part)):
            run.saved[at + i] = part[i]
        at += len(part)


@inlined
def _restore(run):  # type: ignore[no-untyped-def]
    at = 0
    for part in (run.qpos, run.qvel, run.act, run.warmstart):
        for i in range(len(part)):
            part[i] = run.saved[at + i]
        at += len(part)
    run.time[0] = run.clocks[3]


@inlined
def _step(run, step, first):  # type: ignore[no-untyped-def]
    """One step of the length given from the saved state, and the forward pass at its end."""
    if not first:
        _restore(run)
        _forward(run.model, run.data)
    run.timestep[0] = step
    if run.integrator == _RK4:
        _runge_kutta(run.model, run.data, 4)
    elif run.integrator == _EULER:
        _euler(run.model, run.data)
    elif run.integrator == _IMPLICIT:
        _implicit(run.model, run.data)
    else:
        _mj_step(run.model, run.data)
    run.time[0] = run.clocks[4] if step == run.clocks[5] else run.clocks[3] + step
    _forward(run.model, run.data)


@inlined
def _event_function(run):  # type: ignore[no-untyped-def]
    """E and dE/dt, after a forward pass."""
    n, E, dE = run.n_hat, 0.0, 0.0
    for i in range(n):
        Qe = 0.0
        for j in range(n):
            Qe += run.Q_t[i, j] * (run.a[n + j] - run.a[j])
        E += (run.a[n + i] - run.a[i]) * Qe
        dE += (run.a_rate[n + i] - run.a_rate[i]) * Qe
    return E - run.q2, 2 * dE


@inlined
def _may_reach_zero(E_0, dE_0, E_1, dE_1, step, margin):  # type: ignore[no-untyped-def]
    c = (3 * (E_1 - E_0) / step - 2 * dE_0 - dE_1) / step
    d = (dE_0 + dE_1 - 2 * (E_1 - E_0) / step) / step**2
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
    if not 0 < s < step:
        return False
    return E_0 + s * (dE_0 + s * (c + s * d)) + margin >= 0


@compiled
def _hermite_root(low, E_l, dE_l, high, E_h, dE_h):  # type: ignore[no-untyped-def]
    step = high - low
    c = (3 * (E_h - E_l) / step - 2 * dE_l - dE_h) / step
    d = (dE_l + dE_h - 2 * (E_h - E_l) / step) / step**2
    a, b = 0.0, step
    s = step * E_l / (E_l - E_h)
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
        if abs(new - s) <= 1e-15 * step:
            break
        s = new
    return low + max(s, 1e-3 * _TOLERANCE)


@inlined
def _margin(run, step):  # type: ignore[no-untyped-def]
    return 10 * (2 * run.rate * step) ** 4 / 384


@compiled
def _locate(run, low, E_l, dE_l, high, E_h, dE_h):  # type: ignore[no-untyped-def]
    s = _hermite_root(low, E_l, dE_l, high, E_h, dE_h)
    for trial in range(60):
        _step(run, s, False)
        E, dE = _event_function(run)
        if E >= 0:
            high = s
        else:
            low = s
        newton = s - E / dE if dE > 0 else np.inf
        if abs(newton - s) <= _TOLERANCE or high - low <= _TOLERANCE:
            break
        s = newton if low < newton < high and trial % 8 != 7 else (low + high) / 2


@compiled
def _search(run, step, E_0, dE_0, top):  # type: ignore[no-untyped-def]
    """Look for an event inside the step just taken, ever finer; leaves the state there, or at the end."""
    pieces = 2
    while pieces <= _SPLITS:
        s_a, E_a, dE_a = 0.0, E_0, dE_0
        margin = _margin(run, step / pieces) * top
        settled = True
        for j in range(1, pieces + 1):
            s_b = step * j / pieces
            _step(run, s_b, False)
            E_b, dE_b = _event_function(run)
            if E_b >= 0:
                _locate(run, s_a, E_a, dE_a, s_b, E_b, dE_b)
                return True
            settled = settled and not _may_reach_zero(E_a, dE_a, E_b, dE_b, s_b - s_a, margin)
            s_a, E_a, dE_a = s_b, E_b, dE_b
        if settled:
            break
        pieces *= 2
    return False


@inlined
def _status(run):  # type: ignore[no-untyped-def]
    size = 0.0
    for i in range(len(run.qpos)):
        size += abs(run.qpos[i])
    for i in range(len(run.qvel)):
        size += abs(run.qvel[i])
    for i in range(len(run.act)):
        size += abs(run.act[i])
    if not size < 1e10:  # mjMAXVAL; false for NaN, too
        return _DIVERGED
    for i in range(len(run.warnings)):
        if run.warnings[i, 1] != 0:
            return _WARNED
    if run.hinges:
        for i in range(len(run.qpos)):
            if abs(run.qpos[i] - run.qpos_0[i]) > run.limit:
                return _FELL
    else:
        _differentiate_pos(run.model, run.departure.ctypes.data, 1.0, run.qpos_0.ctypes.data, run.qpos.ctypes.data)
        for i in range(len(run.departure)):
            if abs(run.departure[i]) > run.limit:
                return _FELL
    return _RUNNING


@inlined
def _write(run, row):  # type: ignore[no-untyped-def]
    row[0] = run.time[0]
    at = 1
    for part in (run.qpos, run.qvel, run.act, run.sensordata):
        for i in range(len(part)):
            row[at + i] = part[i]
        at += len(part)


@compiled
def _advance(run, dense, samples, events, event_at, count, steps):  # type: ignore[no-untyped-def]
    clocks, counters, time, n = run.clocks, run.counters, run.time, run.n_hat
    status = _RUNNING
    armed = counters[1] != 0
    E, dE = _event_function(run)
    for _ in range(steps):
        t = time[0]
        arm = clocks[1] + run.delta_min if run.trigger == _EVENT and not armed else np.inf
        clock = counters[2] * run.clock if run.trigger == _CLOCK else np.inf
        edge = run.edges[counters[3]] if counters[3] < len(run.edges) else np.inf
        target = min(run.t_end, arm, clock, edge)
        lands = target - t <= run.h * (1 + 1e-9)
        step = target - t if lands else run.h
        fired = False
        if step > 0:
            _save(run)
            clocks[3], clocks[5] = t, step
            clocks[4] = target if lands else clocks[0] + (counters[0] + 1) * run.h
            _step(run, step, True)
            E_1, dE_1 = 0.0, 0.0
            if run.trigger == _EVENT:
                E_1, dE_1 = _event_function(run)
                if armed and np.isfinite(E_1):
                    top = max(abs(E + run.q2), abs(E_1 + run.q2))
                    if _may_reach_zero(E, dE, E_1, dE_1, step, _margin(run, step) * top):
                        fired = _search(run, step, E, dE, top)
                    elif E_1 >= 0:
                        _locate(run, 0.0, E, dE, step, E_1, dE_1)
                        fired = True
                    if fired:
                        lands = lands and time[0] >= target
                        E_1, dE_1 = _event_function(run)
            E, dE = E_1, dE_1
        if fired or lands:
            clocks[0], counters[0] = time[0], 0
        else:
            counters[0] += 1
        status = _status(run)
        if status == _RUNNING and lands:
            if time[0] >= arm:
                armed = True
                fired = fired or E >= 0
            if time[0] >= clock:
                counters[2] += 1
                fired = True
            if time[0] >= run.t_end:
                status = _COMPLETED
        # recording
        row = dense[count[0]]
        row[0] = time[0]
        for i in range(len(run.sensordata)):
            row[1 + i] = run.sensordata[i]
        if fired or status != _RUNNING or time[0] >= clocks[2] - 1e-9 * run.h:
            if step > 0:  # else an event at the very start, whose sample is there already
                _write(run, samples[count[1]])
                count[1] += 1
            if fired:
                _write(run, events[count[2]])
                event_at[count[2]] = count[0]
                count[2] += 1
            clocks[2] = time[0] + run.record_interval
        count[0] += 1
        if fired:
            for i in range(n):
                run.a[n + i] = run.a[i]
            clocks[1] = time[0]
            armed = run.trigger == _EVENT and run.delta_min == 0
        passed = lands and time[0] >= edge
        if passed:
            counters[3] += 1
            run.phase[0] = run.phases[counters[3]]
        if fired or passed:
            _forward(run.model, run.data)
            E, dE = _event_function(run)
        if status != _RUNNING:
            break
    counters[1] = 1 if armed else 0
    return status


class NativeLoop:
    """Steps a composed model from event to event in compiled code; see :class:`icmj.engine.reference.ReferenceLoop`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, schedule: Schedule, qpos_0: Array) -> None:
        block = block_of(model)
        assert block is not None
        structs.check(model, data)
        self._keep = (model, data)
        m, d = model._address, data._address
        t, edge = data.time, schedule.first_edge(data.time)
        block.header[Slot.PHASE] = schedule.phases[edge]
        saved = np.empty(model.nq + 2 * model.nv + model.na)
        self._run = Run(
            model=m,
            data=d,
            integrator=_INTEGRATORS[int(model.opt.integrator)],
            trigger=int(block.header[Slot.TRIGGER]),
            n_hat=block.n_hat,
            timestep=_view(m + structs.offset("mjModel", "opt.timestep"), ctypes.c_double, 1),
            time=_view(d + structs.offset("mjData", "time"), ctypes.c_double, 1),
            phase=block.header[Slot.PHASE : Slot.PHASE + 1],
            qpos=data.qpos,
            qvel=data.qvel,
            act=data.act,
            act_dot=data.act_dot,
            sensordata=data.sensordata,
            warmstart=data.qacc_warmstart,
            warnings=_view(d + structs.offset("mjData", "warning"), ctypes.c_int32, 2 * len(data.warning)).reshape(
                -1, 2
            ),
            a=data.act[block.act],
            a_rate=data.act_dot[block.act],
            Q_t=block.Q_t,
            q2=float(block.header[Slot.Q2]),
            h=schedule.timestep,
            t_end=schedule.t_end,
            delta_min=schedule.delta_min,
            clock=schedule.clock,
            edges=np.array(schedule.edges, dtype=float),
            phases=np.array(schedule.phases, dtype=float),
            record_interval=schedule.record_interval,
            limit=schedule.limit,
            rate=schedule.rate,
            qpos_0=np.array(qpos_0, dtype=float),
            departure=np.zeros(model.nv),
            hinges=model.nq == model.nv,
            saved=saved,
            clocks=np.array([t, t, t + schedule.record_interval, t, t, 0.0]),
            counters=np.array([0, 0, schedule.first_clock(t), edge]),
        )
        mujoco.mj_forward(model, data)
        _verify(model, data, block)

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, writing into ``record``."""
        return Status(
            _advance(self._run, record.dense, record.samples, record.events, record.event_at, record.count, steps)
        )


def _verify(model: mujoco.MjModel, data: mujoco.MjData, block: Block) -> None:
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
                "icmj/engine, or NUMBA_CACHE_DIR), or use the plain-Python loop (native=False)"
            )


def _view(address: int, kind: Any, size: int) -> np.ndarray:
    """A numpy view of the engine's own memory."""
    return np.ctypeslib.as_array((kind * size).from_address(address))
