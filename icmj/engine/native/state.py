"""Data of the flow of the engine: its memory, the plan of a run, the controller, and the run's progress.

Every run is followed with the same data, step by step (:mod:`icmj.engine.native.steps`) or stretch by stretch
(:mod:`icmj.engine.native.stretches`). With them, what both do alike: check the plant, record rows, and the verbs of
:mod:`icmj.simulation.native.loop` that end a run or an interval; and the rates of the closed loop at many states and at
neighbours of each, as one compiled function.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.process import INTERPRETED
from icmj.engine.block import Block, Slot, find_block, find_span, rows_need_forward
from icmj.engine.buffers import Buffers
from icmj.engine.native.field import drive, flow, forward
from icmj.engine.native.memory import (
    address,
    bare,
    engine_function,
    entry,
    exact,
    handles_of,
    inlined,
    run_guarded,
    sources,
)
from icmj.engine.schedule import Schedule, find_next_row
from icmj.engine.stages import Stages, choose_stages, has_rates
from icmj.simulation.native.loop import EDGE, Status
from icmj.simulation.native.taps import FALLS
from icmj.simulation.native.taps import change as change_controller
from icmj.simulation.native.taps import end as end_at_instant
from icmj.simulation.native.taps import fire as fire_controller
from icmj.simulation.native.waves import Waves
from icmj.simulation.taps import ControllerState, History, Taps

RK4, EULER, IMPLICIT, WHOLE_STEP = 0, 1, 2, 3
INTEGRATORS = {
    int(mujoco.mjtIntegrator.mjINT_RK4): RK4,
    int(mujoco.mjtIntegrator.mjINT_EULER): EULER,
    int(mujoco.mjtIntegrator.mjINT_IMPLICIT): IMPLICIT,
    int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST): IMPLICIT,
    int(mujoco.mjtIntegrator.mjINT_DISCRETE): WHOLE_STEP,
}

PROGRESS = np.dtype([
    ("grid", float),         # the step grid starts at this time [s]
    ("steps", np.int64),     # steps done on it
    ("events", np.int64),    # so far
    ("lands", np.int64),     # whether the last step has ended where something is due, or the rule is to be judged
    ("met", np.int64),       # whether it has ended at an event
    ("status", np.int64),    # of the state there
    ("stale", np.int64),     # STALE, RESTARTED, or 0 where rates and levels are those of the state
    ("left", np.int64),      # steps until the caller is asked
    ("next_row", float),     # when the next row is due [s]
    ("begin", float),        # where the step under way begins [s]
    ("end", float),          # where it ends, if it is taken whole [s]
    ("length", float),       # its whole length [s]
    ("source", np.int64),    # of the compiled code; see icmj.engine.native.memory.sources
])  # fmt: skip
"""How far a run has come; one record."""
RESTARTED, STALE = 1, 2


class Engine(NamedTuple):
    """Views of the engine's memory, addresses for its functions, and work arrays.

    ``stages`` says what gives the rates (:mod:`icmj.engine.stages`). Of the motors of a plain model ``moment`` holds
    the moments about the degrees of freedom, ``moment_at`` (motor, degree of freedom) of each, ``gain`` the motors'
    gains. ``applied`` are the generalised forces of pushes, ``rownnz``, ``rowadr``, ``column`` and ``value`` the
    moments of all actuators. ``waves`` holds the signals of disturbance, errors and pushes, and of what time and phase
    time they are. Whatever steps are taken, forces are computed with the model's ``own`` time step [s]: what the engine
    makes depend on it (how stiff a constraint may be, activations that are taken a step ahead) belongs to the plant. A
    step is a ``lean`` one where Runge and Kutta's stages are called here; ``k`` holds the rates of (qpos, qvel, act) at
    them; ``limited`` are the activations with a range, from ``low`` to ``high``. ``scalars`` are (address in qpos,
    address in qvel) of hinges, slides and translations, ``quaternions`` those of rotations.
    """

    model: Any
    data: Any
    timestep: Array
    time: Array
    warnings: np.ndarray
    own: float
    integrator: int
    qpos: Array
    qvel: Array
    act: Array
    sensordata: Array
    warmstart: Array
    plastic: Array
    phase: Array
    saved: Array
    stages: int
    lean: bool
    cameras: bool
    tendons: bool
    rows_need_forward: bool
    block: Array
    ctrl: Array
    qacc: Array
    qacc_smooth: Array
    act_dot: Array
    passive: Array
    bias: Array
    force: Array
    moment: Array
    moment_at: np.ndarray
    gain: Array
    applied: Array
    rownnz: np.ndarray
    rowadr: np.ndarray
    column: np.ndarray
    value: Array
    waves: Array
    k: Array
    limited: np.ndarray
    low: Array
    high: Array
    scalars: np.ndarray
    quaternions: np.ndarray
    first: int


class RunPlan(NamedTuple):
    """A :class:`icmj.engine.schedule.Schedule`, with the limits at which the plant has fallen.

    The last of ``edges`` and ``breaks`` is infinite; ``most`` is the room that rows of one step may take.
    """

    timestep: float
    t_end: float
    edges: Array
    phases: Array
    record_interval: float
    breaks: Array
    limits: Array
    rate: float
    events: int
    qpos_0: Array
    departure: Array
    hinges: bool
    tolerance: float
    most: int


class FaceLevels(NamedTuple):
    """The faces of the event rule of a controller that is followed step by step, and room for their values.

    ``a`` and ``a_rate`` are the controller's state and its rate, in the engine's memory; ``spans`` the columns of each
    row of ``R`` that are not zero. ``before``, ``left`` and ``now`` hold (E_j, dE_j/dt) of every face: at the step's
    begin, at the left end of the piece that is looked at, and where the engine is; ``top`` the larger |E_j + 1| of the
    step's ends.
    """

    a: Array
    a_rate: Array
    R: Array
    cuts: np.ndarray
    spans: np.ndarray
    before: Array
    left: Array
    now: Array
    top: Array


class Reader(NamedTuple):
    """What a controller that is followed by stretches reads of the engine, and where its commands go.

    Attributes:
        entries, gain, offset: y = gain · sensordata[entries] + offset, shape (n_y,).
        actuators, b: of each command, shape (n_u,).
        errors: of the outputs as they are read, n_y rows.
        joint: whether the controller's state is integrated with the plant.
        M, N, K, S: if joint, of each mode as the model holds them (:func:`icmj.engine.composition.at_ports`).
    """

    entries: np.ndarray
    gain: Array
    offset: Array
    actuators: np.ndarray
    b: Array
    errors: Waves
    joint: bool
    M: Array
    N: Array
    K: Array
    S: Array


class EngineTrack(NamedTuple):
    """Where a run by stretches is.

    Attributes:
        t: begin and end of the stretch under way, the last row, and when the next row was due as the stretch began
            [s], shape (4,).
        marks: guard that ends the stretch, how far it has come, samples of it, why it ends, samples and rows that were
            recorded at its begin, and whether of two rows at an instant the second is to stay, shape (7,).
        at, y: samples of the stretch under way, their outputs and, if joint, the controller's states, shapes (S,),
            (S, n_y + N_a).
        begin: the engine's state at its begin.
        curves: polynomials of outputs and the controller's states, shape (n_y + N_a, p + 1).
        states: the engine's rows there, shape (S, width).
        near: numbers of the samples that are read, shape (S,).
    """

    t: Array
    marks: np.ndarray
    at: Array
    y: Array
    states: Array
    near: np.ndarray
    begin: Array
    curves: Array


class FlowData(NamedTuple):
    """All that a run is followed with, and what the verbs of :mod:`icmj.simulation.native.taps` take.

    ``levels`` are those of the edges of what acts (:mod:`icmj.simulation.native.taps`); ``end`` is that of the run [s].
    A run comes back to its caller at ``until`` or later [s]. The way by steps has no history, reader and track, and the
    way by stretches no faces: 0 stands for them, which takes less time to compile.
    """

    engine: Engine
    plan: RunPlan
    faces: FaceLevels | int
    progress: Any
    record: Buffers
    taps: Taps
    history: History | int
    now: ControllerState
    reader: Reader | int
    track: EngineTrack | int
    levels: np.ndarray
    until: float
    time: Array
    edges: Array
    end: float


def engine_of(model: mujoco.MjModel, data: mujoco.MjData, phase: Array, smooth: bool = False) -> Engine:
    """Views of a model and its data, which must outlive them; of a motion known to be ``smooth`` rates are enough.

    Raises:
        ModelError: if MuJoCo's structs do not lie in memory as they are declared.
    """
    handles = handles_of(model, data)
    integrator = INTEGRATORS[int(model.opt.integrator)]
    motors = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT)[:-1]  # the last is the controller
    at = int(model.numeric_adr[-1])
    controller = model.numeric_data[at : at + int(model.numeric_size[-1])]
    stages = choose_stages(model) if smooth or integrator == RK4 else Stages.WHOLE
    scalars, quaternions = _find_turns(model)
    size = model.nq + model.nv + model.na
    of = np.repeat(np.arange(model.nactuator), model.actuator_actnum)  # the actuator of each activation
    limited = np.flatnonzero(model.actuator_actlimited[of])
    low, high = model.actuator_actrange[of[limited]].T.copy()
    return Engine(
        **handles._asdict(),
        own=float(model.opt.timestep),
        integrator=integrator,
        qpos=data.qpos,
        qvel=data.qvel,
        act=data.act,
        sensordata=data.sensordata,
        warmstart=data.qacc_warmstart,
        plastic=data.plastic,
        phase=phase,
        saved=np.empty(model.nq + 2 * model.nv + model.na + model.nplastic),
        # the engine's other integrators read more of what a forward pass leaves
        stages=int(stages),
        lean=integrator == RK4 and has_rates(model),
        cameras=bool(model.ncam),
        tendons=bool(model.ntendon),
        rows_need_forward=rows_need_forward(model),
        block=controller,
        ctrl=data.ctrl,
        qacc=data.qacc,
        qacc_smooth=data.qacc_smooth,
        act_dot=data.act_dot,
        passive=data.qfrc_passive,
        bias=np.zeros(model.nv),
        force=np.zeros(model.nv),
        moment=model.actuator_gear[motors, 0].copy(),
        moment_at=np.column_stack([motors, model.jnt_dofadr[model.actuator_trnid[motors, 0]]]).astype(np.int64),
        gain=model.actuator_gainprm[motors, 0].copy(),
        applied=data.qfrc_applied,
        rownnz=data.moment_rownnz,
        rowadr=data.moment_rowadr,
        column=data.moment_colind,
        value=data.actuator_moment,
        waves=np.full(int(controller[Slot.SIGNALS]) + 2, np.nan),
        k=np.empty((4, size)),
        limited=limited,
        low=low,
        high=high,
        scalars=scalars,
        quaternions=quaternions,
        first=int(controller[Slot.ACT]),
    )


def _find_turns(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """(address in qpos, address in qvel) of what moves as vectors do, and of each quaternion."""
    scalars, quaternions = [], []
    for kind, q, v in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
        free = mujoco.mjtJoint(kind) == mujoco.mjtJoint.mjJNT_FREE
        if free:
            scalars += [(q + i, v + i) for i in range(3)]
        if free or mujoco.mjtJoint(kind) == mujoco.mjtJoint.mjJNT_BALL:
            quaternions.append((q + 3 * free, v + 3 * free))
        else:
            scalars.append((q, v))
    single, quadruple = (np.array(found, dtype=np.int64).reshape(-1, 2) for found in (scalars, quaternions))
    return single, quadruple


def plan_of(schedule: Schedule, qpos_0: Array, model: mujoco.MjModel) -> RunPlan:
    """The schedule in the form for compiled code."""
    return RunPlan(
        timestep=float(schedule.timestep),
        t_end=float(schedule.t_end),
        edges=np.append(schedule.edges, np.inf),
        phases=np.array(schedule.phases, dtype=float),
        record_interval=float(schedule.record_interval),
        breaks=np.append(schedule.breaks, np.inf),
        limits=np.array(schedule.limits, dtype=float),
        rate=float(schedule.rate),
        events=int(schedule.events),
        qpos_0=np.array(qpos_0, dtype=float),
        departure=np.zeros(model.nv),
        hinges=bool(model.nq == model.nv),
        tolerance=float(schedule.tolerance),
        most=4 + (int(min(schedule.timestep / schedule.record_interval, 1e9)) if schedule.tolerance > 0 else 0),
    )


def faces_of(block: Block, data: mujoco.MjData) -> FaceLevels:
    """The event rule of the controller in a model."""
    faces = len(block.cuts)
    return FaceLevels(
        a=data.act[block.act],
        a_rate=data.act_dot[block.act],
        R=np.ascontiguousarray(block.R),
        cuts=block.edges,
        spans=np.array([find_span(row[None, :]) for row in block.R], dtype=np.int64).reshape(-1, 2),
        before=np.zeros((faces, 2)),
        left=np.zeros((faces, 2)),
        now=np.zeros((faces, 2)),
        top=np.zeros(faces),
    )


def new_progress() -> Any:
    """A new record of a run's progress."""
    return [SimpleNamespace()] if INTERPRETED else np.zeros(1, PROGRESS)


def progress_at(t: float, plan: RunPlan, progress: Any) -> None:
    """Set the record to the beginning of a run, or a flight, right after an event at ``t``."""
    values = dict.fromkeys(PROGRESS.names or (), 0) | {
        **dict.fromkeys(("grid", "begin", "end"), t),
        "stale": RESTARTED,
        "next_row": find_next_row(t, plan.record_interval, plan.breaks),
    }
    if INTERPRETED:
        revise(progress, **values)
    else:
        progress[0] = tuple(values.values())


def revise(progress: Any, **values: Any) -> None:
    """Change fields of the record."""
    if INTERPRETED:
        vars(progress[0]).update(values)
    else:
        for name, value in values.items():
            progress[name] = value


# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


_WHOLE = int(Stages.WHOLE)


def neighbours_of(model: mujoco.MjModel, data: mujoco.MjData) -> Engine:
    """The data of :func:`rates_at` for a composed model and its data, which must outlive them."""
    block = find_block(model)
    assert block is not None
    return engine_of(model, data, block.header[Slot.PHASE : Slot.PHASE + 1], smooth=True)


@cache
def _entry() -> Any:
    source = sources()

    @entry
    def visit(engine, rows, moves, still, rates):  # type: ignore[no-untyped-def]
        if source:
            e, rows, moves, rates = bare(engine), bare(rows), bare(moves), bare(rates)
            nq, nv, na = len(e.qpos), len(e.qvel), len(e.act)
            for i in range(len(rows)):
                seen = False
                for j in range(len(moves)):
                    for k in range(nq):
                        e.qpos[k] = rows[i, k] + moves[j, k]
                    for k in range(nv):
                        e.qvel[k] = rows[i, nq + k] + moves[j, nq + k]
                    for k in range(na):
                        e.act[k] = rows[i, nq + nv + k] + moves[j, nq + nv + k]
                    if seen and still[j] and e.stages != _WHOLE:
                        drive(e)
                    else:
                        flow(e)
                    seen = still[j]
                    for k in range(nv):
                        rates[i, j, k] = e.qvel[k]
                        rates[i, j, nv + k] = e.qacc[k]
                    for k in range(na):
                        rates[i, j, 2 * nv + k] = e.act_dot[k]

    return visit


def rates_at(engine: Engine, rows: Array, moves: Array, faulty: bool = False) -> Array:
    """(qvel, qacc, act_dot) at all ``rows`` (qpos, qvel, act), moved by each of ``moves``.

    Shapes (T, w), (m, w) → (T, m, 2 n_v + n_a). ``faulty`` says that MuJoCo may give up on the way.

    Raises:
        EngineFault: if it does.
    """
    engine.waves[:] = np.nan  # of another disturbance, perhaps
    still = ~moves[:, : len(engine.qpos) + len(engine.qvel)].any(axis=1)
    rates = np.empty((len(rows), len(moves), 2 * len(engine.qvel) + len(engine.act)))
    arguments = engine, np.ascontiguousarray(rows), np.ascontiguousarray(moves), still, rates
    run_guarded(_entry(), arguments, faulty)
    return rates


# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


_row_after = inlined(find_next_row)
_differentiate_pos = engine_function("mj_differentiatePos", "void(intp, intp, float64, intp, intp)")

# constants that compiled code freezes
_RUNNING, _FELL, _REACHED = int(Status.RUNNING), int(Status.FELL), int(Status.REACHED)
_DIVERGED, _WARNED = int(Status.DIVERGED), int(Status.WARNED)


@inlined
def check_state(engine, plan):  # type: ignore[no-untyped-def]
    """The status that the state gives: running, fallen, diverged (too large, or not finite), or warned."""
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
def _note_outputs(engine, record):  # type: ignore[no-untyped-def]
    row = record.dense[record.count[0]]
    row[0] = engine.time[0]
    outputs = 1 + len(engine.sensordata)
    for i in range(outputs - 1):
        row[1 + i] = engine.sensordata[i]
    for i in range(len(row) - outputs):  # of a controller that is read by itself, its state
        row[outputs + i] = engine.act[engine.first + i]
    record.count[0] += 1


@inlined
def note(engine, progress, plan, record, fired, due):  # type: ignore[no-untyped-def]
    """Record the outputs at the engine's state, and a row if one is due or an event fires."""
    count = record.count
    _note_outputs(engine, record)
    if fired or due:
        if engine.rows_need_forward:
            forward(engine.model, engine.data)
        if progress[0].length > 0:  # else an event at the very start, whose row is there already
            _write(engine, record.rows[count[1]])
            count[1] += 1
        if fired:
            _write(engine, record.events[count[2]])
            record.event_at[count[2]] = count[0] - 1
            count[2] += 1
        progress[0].next_row = _row_after(engine.time[0], plan.record_interval, plan.breaks)


@inlined
def note_row(engine, record):  # type: ignore[no-untyped-def]
    """Record a row of the engine's state, whose outputs there are already."""
    if engine.rows_need_forward:
        forward(engine.model, engine.data)
    _write(engine, record.rows[record.count[1]])
    record.count[1] += 1


@inlined
def note_event(engine, record):  # type: ignore[no-untyped-def]
    """Record an event where the outputs were recorded last; they are again if the caller has taken them since."""
    if record.count[0] == 0:
        _note_outputs(engine, record)
    _write(engine, record.events[record.count[2]])
    record.event_at[record.count[2]] = record.count[0] - 1
    record.count[2] += 1


# verbs of :mod:`icmj.simulation.native.loop`, the same for both ways; a way's own are ``travel``, ``cross``, ``note``


@exact
def change(f):  # type: ignore[no-untyped-def]
    """Pass the edges that are due, and the phase with them; whether a reading or the controller's state jumps."""
    jumps = change_controller(f)
    f.engine.phase[0] = f.plan.phases[f.now.due[EDGE]]
    return jumps


@exact
def fire(f):  # type: ignore[no-untyped-def]
    """An event."""
    fire_controller(f)
    f.progress[0].events += 1
    f.progress[0].stale = STALE


@exact
def end(f, event):  # type: ignore[no-untyped-def]
    """Whether the run ends, and how."""
    if event and f.progress[0].events >= f.plan.events and f.now.met[FALLS] == 0:
        return _REACHED
    return end_at_instant(f, event)


@exact
def note_rough(record, t):  # type: ignore[no-untyped-def]
    """Record that something is not smooth at ``t``."""
    record.rough[record.count[4]] = t
    record.count[4] += 1
