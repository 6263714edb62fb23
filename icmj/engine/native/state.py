"""Data of the compiled loops: the engine's memory, the plan of a run, the event rule, and the run's progress."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.environment import INTERPRETED
from icmj.engine.block import Block, Slot, span
from icmj.engine.native.memory import handles_of
from icmj.engine.schedule import Schedule, row_after
from icmj.engine.stages import Stages, rows_need_forward, stages_of
from icmj.engine.tableau import rounded

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
    ("last_event", float),   # [s]
    ("armed", np.int64),     # whether the event function is watched
    ("clock", np.int64),     # number of the clock's next event
    ("sample", float),       # when the sample is taken for which the rule has reached its threshold [s]
    ("acted", np.int64),     # number of the event that acts next: the clock's, or counted from the run's start
    ("edge", np.int64),      # number of the next edge of the disturbance
    ("events", np.int64),    # so far
    ("next_row", float),     # when the next row is due [s]
    ("begin", float),        # where the step under way begins [s]
    ("end", float),          # where it ends, if it is taken whole [s]
    ("length", float),       # its whole length [s]
    ("next_step", float),    # of an adaptive loop: the length to try next [s]
    ("first_step", float),   # the length to try after an event [s]
    ("fresh", np.int64),     # whether no step has been taken since the last event
    ("source", np.int64),    # of the compiled code; see icmj.engine.native.compilation.sources
])  # fmt: skip
"""How far a run has come; one record."""


class Engine(NamedTuple):
    """Views of the engine's memory, addresses for its functions, and work arrays.

    ``stages`` says what gives the rates (:mod:`icmj.engine.stages`). Of the motors of a plain model ``moment`` holds
    the moments about the degrees of freedom, ``moment_at`` (motor, degree of freedom) of each, ``gain`` the motors'
    gains. ``applied`` are the generalised forces of pushes, ``rownnz``, ``rowadr``, ``column`` and ``value`` the
    moments of all actuators. ``waves`` holds the signals of disturbance, errors and pushes, and of what time and phase
    time they are. ``k`` holds (qvel, qacc, act_dot) at the stages of an integrator's step.
    """

    model: Any
    data: Any
    timestep: Array
    time: Array
    warnings: np.ndarray
    integrator: int
    qpos: Array
    qvel: Array
    act: Array
    sensordata: Array
    warmstart: Array
    phase: Array
    saved: Array
    stages: int
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
    sum: Array
    first: int


class Plan(NamedTuple):
    """A :class:`icmj.engine.schedule.Schedule`, with the limits at which the plant has fallen.

    ``ticks`` is the delay in intervals of the clock where it is a multiple of that, else −1.
    """

    timestep: float
    t_end: float
    delta_min: float
    clock: float
    delay: float
    sampling: float
    ticks: int
    edges: Array
    phases: Array
    record_interval: float
    limits: Array
    rate: float
    events: int
    qpos_0: Array
    departure: Array
    hinges: bool
    tolerance: float


class Rule(NamedTuple):
    """The controller's states, their reset, the faces of its event rule, and room for their values.

    ``before``, ``left`` and ``now`` hold (E_j, dE_j/dt) of every face: at the step's begin, at the left end of the
    piece that is looked at, and where the engine is; ``top`` the larger |E_j + 1| of the step's ends.
    """

    a: Array
    a_rate: Array
    J: Array
    G: Array
    R: Array
    cuts: np.ndarray
    spans: np.ndarray
    scratch: Array
    before: Array
    left: Array
    now: Array
    top: Array


def engine_of(model: mujoco.MjModel, data: mujoco.MjData, phase: Array, adaptive: bool = False) -> Engine:
    """Views of a model and its data, which must outlive them.

    Raises:
        ModelError: if MuJoCo's structs do not lie in memory as they are declared.
    """
    handles = handles_of(model, data)
    integrator = INTEGRATORS[int(model.opt.integrator)]
    motors = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT)[:-1]  # the last is the controller
    at = int(model.numeric_adr[-1])
    controller = model.numeric_data[at : at + int(model.numeric_size[-1])]
    return Engine(
        **handles._asdict(),
        integrator=integrator,
        qpos=data.qpos,
        qvel=data.qvel,
        act=data.act,
        sensordata=data.sensordata,
        warmstart=data.qacc_warmstart,
        phase=phase,
        saved=np.empty(model.nq + 2 * model.nv + model.na),
        # the engine's other integrators read more of what a forward pass leaves, and turn quaternions their own way
        stages=int(stages_of(model) if adaptive or (integrator == RK4 and model.nq == model.nv) else Stages.WHOLE),
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
        k=np.empty((4, 2 * model.nv + model.na)),
        sum=np.empty(2 * model.nv + model.na),
        first=int(controller[Slot.ACT]),
    )


def plan_of(schedule: Schedule, qpos_0: Array, model: mujoco.MjModel) -> Plan:
    """The schedule in the form for compiled code."""
    return Plan(
        timestep=float(schedule.timestep),
        t_end=float(schedule.t_end),
        delta_min=float(schedule.delta_min),
        clock=float(schedule.clock),
        delay=float(schedule.delay),
        sampling=float(schedule.sampling),
        ticks=_ticks(schedule),
        edges=np.array(schedule.edges, dtype=float),
        phases=np.array(schedule.phases, dtype=float),
        record_interval=float(schedule.record_interval),
        limits=np.array(schedule.limits, dtype=float),
        rate=float(schedule.rate),
        events=int(schedule.events),
        qpos_0=np.array(qpos_0, dtype=float),
        departure=np.zeros(model.nv),
        hinges=bool(model.nq == model.nv),
        tolerance=float(schedule.tolerance),
    )


def rule_of(block: Block, data: mujoco.MjData) -> Rule:
    """The controller's part of the state and its event rule."""
    faces = len(block.cuts)
    return Rule(
        a=data.act[block.act],
        a_rate=data.act_dot[block.act],
        J=np.ascontiguousarray(block.J),
        G=np.ascontiguousarray(block.G),
        R=np.ascontiguousarray(block.R),
        cuts=block.edges,
        spans=np.array([span(row[None, :]) for row in block.R], dtype=np.int64).reshape(-1, 2),
        scratch=np.empty(len(block.J)),
        before=np.zeros((faces, 2)),
        left=np.zeros((faces, 2)),
        now=np.zeros((faces, 2)),
        top=np.zeros(faces),
    )


def new_progress() -> Any:
    """A new record of a run's progress."""
    return [SimpleNamespace()] if INTERPRETED else np.zeros(1, PROGRESS)


def progress_at(t: float, schedule: Schedule, progress: Any) -> None:
    """Set the record to the beginning of a run, or a flight, right after an event at ``t``."""
    clock, step = schedule.first_clock(t), rounded(schedule.first_step)
    values = dict.fromkeys(PROGRESS.names or (), 0) | {
        **dict.fromkeys(("grid", "last_event", "begin", "end"), t),
        "clock": clock,
        "sample": np.inf,
        "acted": clock - 1 if np.isfinite(schedule.clock) else 0,
        "edge": schedule.first_edge(t),
        "next_row": row_after(t, schedule.record_interval),
        **dict.fromkeys(("next_step", "first_step"), step),
        "fresh": 1,
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


def _ticks(schedule: Schedule) -> int:
    if not np.isfinite(schedule.clock):
        return -1
    number = round(schedule.delay / schedule.clock)
    return number if schedule.clock_action(0) == number * schedule.clock else -1
