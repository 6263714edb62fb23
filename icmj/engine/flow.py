"""A run of the closed loop on the engine, followed from where its data are until it ends.

A controller that reads the current outputs alone is taken step by step (:mod:`icmj.engine.native.steps`). Any other is
taken stretch by stretch (:mod:`icmj.engine.native.stretches`), from its realisation alone: over a stretch
(:mod:`icmj.simulation.native.taps`) what is read of earlier is known ahead. If that is all that the controller reads,
the engine integrates under its command, a polynomial in time, as it would under any other input; if not, the
controller's state is integrated with the plant. Both ways have the same data, which are made here.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.interruption import defer_interrupt
from icmj.base.process import SWITCH
from icmj.engine.block import Block, Slot
from icmj.engine.buffers import Buffers, make_buffers
from icmj.engine.closed_loop import ComposedLoop
from icmj.engine.composition import at_ports
from icmj.engine.extremes import ExtremesTracker
from icmj.engine.faults import EngineFault, can_fault, format_fault
from icmj.engine.native.memory import run_guarded
from icmj.engine.native.state import (
    EngineTrack,
    Reader,
    engine_of,
    faces_of,
    new_progress,
    plan_of,
    progress_at,
)
from icmj.engine.native.steps import compile_steps
from icmj.engine.native.stretches import compile_stretches
from icmj.engine.schedule import Schedule
from icmj.errors import ModelError
from icmj.simulation import ending
from icmj.simulation.native.loop import Status
from icmj.simulation.rows import part_rows
from icmj.simulation.taps import (
    POWERS,
    ControllerState,
    History,
    Taps,
    begin,
    begin_at,
    compute_first_command,
    copy_of,
    lengthen,
    list_levels,
    make_taps,
    make_waves,
    widen,
)

CHUNK = 2000  # steps between two looks at the keyboard and the progress bar
_STRETCHES = 512  # the same of stretches
_SWING = 3.0  # rad of a sinusoid that the polynomial of a stretch takes in: to 1e-11 of it
_SAMPLES = 4096  # of one stretch
# steps leave these alone: it takes a fifth less time to compile without
_NO_TAPS: Any = dict.fromkeys(("M", "K", "S", "Q", "c", "used", "R", "watched", "F", "nodes", "fit"), 0)
_NO_STATE: Any = dict.fromkeys(("roots", "A", "u", "last", "values", "reach", "g", "stack", "spans"), 0)


@dataclass(frozen=True, eq=False)
class Stand:
    """The progress of a run, from which it can be continued again.

    Attributes:
        t: now [s].
        history, now: of the controller.
        state: of the engine, (qpos, qvel, act, plastic).
    """

    t: float
    history: History
    now: ControllerState
    state: tuple[Array, Array, Array, Array]

    def data(self, model: mujoco.MjModel) -> mujoco.MjData:
        """The engine's data there."""
        data = mujoco.MjData(model)
        data.time = self.t
        data.qpos[:], data.qvel[:], data.act[:], data.plastic[:] = self.state
        return data


@dataclass(frozen=True, eq=False)
class Record:
    """The record of a run.

    Attributes:
        rows, events: rows (t, qpos, qvel, act, sensordata), shapes (N, width), (K, width).
        y_max, y_min: extremes of the outputs (departures) over the interval before each event, shapes (K, n_y).
        steps: steps taken.
        outcome: how it ended.
        u, mode: command and mode at the rows, shapes (N, n_u), (N,).
        jumps, leads: times and commands right after rows, and right before others, shapes (K, 1 + n_u), (S, 1 + n_u);
            not of a run by steps (:class:`icmj.simulation.simulation.Simulation`).
        stand: a while before the end, to repeat what came after; ``None`` if nobody asked for it.
    """

    rows: Array
    events: Array
    y_max: Array
    y_min: Array
    steps: int
    outcome: ending.Outcome
    u: Array
    mode: np.ndarray
    jumps: Array
    leads: Array
    stand: Stand | None = None


class Flow:
    """A composed loop on its way from instant to instant."""

    def __init__(
        self,
        loop: ComposedLoop,
        data: mujoco.MjData,
        schedule: Schedule,
        stand: Stand | None = None,
        a: Array | None = None,
    ) -> None:
        """Start from the state in ``data``, right after an event, or at a ``stand``; within :meth:`ComposedLoop.ready`.

        ``a`` is the state of a controller that reads delayed outputs alone, which is not in ``data``; zero if ``None``.

        Raises:
            ModelError: if compiled code cannot work on this MuJoCo, or the callbacks are not of this code.
        """
        mujoco.mj_forward(loop.model, data)
        block = loop.block
        self.loop, self.data, self.schedule, self._faulty = loop, data, schedule, can_fault(loop.model)
        phase = block.header[Slot.PHASE : Slot.PHASE + 1]
        self._plan = plan_of(schedule, loop.plant.linearisation.point.qpos, loop.model)
        self._engine = engine_of(loop.model, data, phase, schedule.tolerance > 0)
        self._faces, self._progress = faces_of(block, data), new_progress()
        self.taps = _taps_of(loop)
        self.history, self.now = _begin(loop, self.taps, data, a) if stand is None else (stand.history, stand.now)
        if loop.by_steps:  # its state is the engine's own
            self.now = self.now._replace(a=self._faces.a)
        self._reader = None if loop.by_steps else _reader_of(loop, schedule)
        self.track = _track_of(loop, data.time)
        self._levels = _levels_of(loop, schedule)
        self._lean = self._leave_out()
        outputs = self.track.y.shape[1] - loop.n_y + loop.model.nsensordata
        self.record: Buffers = make_buffers(CHUNK, outputs, loop.width, len(loop.controller.realisation.K))
        self.start(stand is None)
        _verify(data, block)

    def share(self, loop: ComposedLoop, schedule: Schedule) -> Flow:
        """A flow by steps of another loop of the same model, with the same work arrays; for the same thread."""
        other = copy(self)
        other.loop, other.schedule, other.taps = loop, schedule, _taps_of(loop)
        other._plan = plan_of(schedule, loop.plant.linearisation.point.qpos, loop.model)
        other._levels = _levels_of(loop, schedule)
        other._lean = other._leave_out()
        return other

    def _leave_out(self) -> tuple[Any, ...]:
        """The parts of a flow by steps that others do not have, without what it leaves alone; else nothing."""
        if not self.loop.by_steps:
            return ()
        return self._faces, self.taps._replace(**_NO_TAPS), self.now._replace(**_NO_STATE)

    def start(self, anew: bool = True) -> None:
        """Start from the state in the data; ``anew``, right after an event."""
        t = self.data.time
        progress_at(t, self._plan, self._progress)
        if anew and self.loop.by_steps:
            begin_at(self.taps, self.now, self._plan.edges, t)
        self.loop.block.header[Slot.PHASE] = self.schedule.phases[self.schedule.first_edge(t)]
        mujoco.mj_forward(self.loop.model, self.data)
        self.record.clear()

    def advance(self, until: float = np.inf) -> Status:
        """Go on for a while, at most to a step or stretch that begins at ``until`` or later [s].

        Raises:
            EngineFault, mujoco.FatalError: if MuJoCo gives up.
        """
        known = self._engine, self._plan, self._progress, self.record, self._levels, until
        if self._lean:
            return Status(run_guarded(compile_steps(), (*known, CHUNK, *self._lean), self._faulty))
        parts = self.taps, self.history, self.now, self._reader, self.track
        status = Status(run_guarded(compile_stretches(), (*known, _STRETCHES, *parts), self._faulty))
        if status == Status.FULL:
            self.history, self.now = widen(self.history), lengthen(self.now)
            return Status.RUNNING
        return status

    @property
    def between(self) -> bool:
        """Whether it is between two steps or stretches."""
        return not self.track.marks[1]

    @property
    def full(self) -> bool:
        """Whether the buffers should be emptied; after every while of steps, which fills them."""
        return self.loop.by_steps or int(self.record.count[[0, 1, 4]].max()) > CHUNK // 8

    def stand(self) -> Stand:
        """A copy of the present progress, with the engine's state."""
        history, now = copy_of(self.history, self.now)
        data = self.data
        state = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.plastic.copy()
        return Stand(float(data.time), history, now, state)


def _taps_of(loop: ComposedLoop) -> Taps:
    """The controller's numbers for compiled code."""
    realisation = loop.controller.realisation
    rate = 1.0  # steps have no stretches
    if not loop.by_steps:
        # of a step that is a whole stretch the dense output is coarser than its end, from which its length follows
        own = max([loop.fastest_rate, *(1 / tau for tau in realisation.delayed[:1])])
        rate = max(own, loop.noise / _SWING)
    return make_taps(realisation, loop.n_y, rate, exact=False)


def _levels_of(loop: ComposedLoop, schedule: Schedule) -> np.ndarray:
    """The levels of the edges, which mean nothing to steps."""
    if loop.by_steps:
        return np.zeros(len(schedule.edges), np.int64)
    return list_levels(schedule.edges, loop.acting).astype(np.int64)


def _begin(loop: ComposedLoop, taps: Taps, data: mujoco.MjData, a: Array | None) -> tuple[History, ControllerState]:
    """The controller at the begin of a run, where the engine's data are; ``a`` is its state if they do not have it."""
    realisation = loop.controller.realisation
    if loop.own:
        a = data.act[loop.block.act][: loop.own]
    if loop.by_steps:
        return begin(taps, realisation, loop.y(data.sensordata), a, capacity=1)
    return begin(taps, realisation, loop.y(data.sensordata) + loop.errors(0.0), a)


def _reader_of(loop: ComposedLoop, schedule: Schedule) -> Reader:
    """What a run by stretches reads of the engine."""
    realisation, here, block, n_y = loop.controller.realisation, loop.plant.linearisation, loop.block, loop.n_y
    joint, ports = loop.embedding.rated, here.ports
    nu, entries, n_a = len(block.ctrl_0), len(block.y_0), realisation.layout.size
    modes = [at_ports(loop.plant, mode, nu, entries) for mode in realisation.modes if joint]
    M, N, K, S = (
        np.array([getattr(mode, letter) for mode in modes], dtype=float).reshape(len(modes), *shape)
        for letter, shape in (("M", (n_a, n_a)), ("N", (n_a, entries)), ("K", (nu, n_a)), ("S", (nu, entries)))
    )
    return Reader(
        entries=ports.entries.astype(np.int64), gain=np.ascontiguousarray(ports.g),
        offset=np.ascontiguousarray(ports.beta - here.y),
        actuators=ports.actuators.astype(np.int64), b=np.ascontiguousarray(ports.b),
        errors=make_waves(schedule.t_end, (loop.errors, np.eye(n_y))), joint=joint, M=M, N=N, K=K, S=S,
    )  # fmt: skip


def _track_of(loop: ComposedLoop, t: float) -> EngineTrack:
    """Room for what a run records, which is at ``t`` [s]."""
    model = loop.model
    samples, own = (1, 0) if loop.by_steps else (_SAMPLES, loop.own)
    return EngineTrack(
        t=np.array([t, t, t, 0.0]), marks=np.array([-1, 0, 0, 0, 0, 0, 0]),
        at=np.zeros(samples), y=np.zeros((samples, loop.n_y + own)), states=np.zeros((samples, loop.width)),
        near=np.zeros(samples, np.int64), begin=np.zeros(model.nq + model.nv + model.na + model.nplastic),
        curves=np.zeros((loop.n_y + own, POWERS)),
    )  # fmt: skip


def follow(
    loop: ComposedLoop,
    data: mujoco.MjData,
    schedule: Schedule,
    progress: Callable[[float], None] | None = None,
    stand: Stand | None = None,
    *,
    a: Array | None = None,
    repeatable: bool = False,
) -> Record:
    """Follow a loop from ``data`` until the schedule's end, the plant falls or diverges, or the user interrupts.

    ``data`` are right after an event, or at a ``stand``; ``a`` is as in :class:`Flow`. What is ``repeatable`` has a
    stand in its record.
    """
    status, fault, stopped, crowded = Status.RUNNING, "", False, None
    pace, every = ending.EventPace(schedule.t_end), max(1.0, 3 * loop.controller.realisation.taps[-1])
    with loop.ready():
        flow = Flow(loop, data, schedule, stand, a)
        log = Log(flow)
        stands = [flow.stand()] * 2 if repeatable else []
        try:
            while status == Status.RUNNING and crowded is None:
                due = stands[-1].t + every if stands else np.inf
                try:
                    status = flow.advance(due)
                except (EngineFault, mujoco.FatalError) as error:  # what was simulated before stays
                    fault = str(error) if isinstance(error, EngineFault) else format_fault(error)
                    status = Status.DIVERGED
                if flow.full or status != Status.RUNNING:
                    with defer_interrupt():
                        crowded = pace.stalled(*log.take())
                if data.time >= due and flow.between:
                    stands = [stands[-1], flow.stand()]
                if progress is not None:
                    progress(min(data.time / schedule.t_end, 1.0))
        except KeyboardInterrupt:
            stopped = True
            with defer_interrupt():
                log.take()
            if not log.steps:  # there is nothing to keep; it may have been compiling
                raise
    rows, events = np.concatenate(log.rows), np.concatenate(log.events)
    t = float(data.time) if status == Status.STALLED else log.t
    outcome = loop.outcome(Status.RUNNING if stopped else status, t, data, schedule, events[:, 0])
    if fault:
        outcome = ending.end_diverged(t, fault)
    elif crowded is not None and status == Status.RUNNING and not stopped:
        outcome = ending.end_stalled(t, crowded)
    if loop.by_steps:
        u, mode = -loop.state(rows) @ loop.controller.realisation.K.T, np.zeros(len(rows), np.int64)
        jumps = leads = np.zeros((0, 0))
    else:
        u, mode = np.concatenate(log.u), np.concatenate(log.mode)
        kept, jumps, leads, mode = part_rows(rows[:, 0], u, mode)
        rows, u, mode = rows[kept], u[kept], mode[kept]
    y_max, y_min = log.tracker.result()
    stand = stands[0] if stands else None
    return Record(rows, events, y_max, y_min, log.steps, outcome, u, mode, jumps, leads, stand)


class Log:
    """What a flow has recorded, chunk by chunk.

    Attributes:
        t: how far that goes [s].
        steps: taken so far.
        rows, u, mode, events: chunks of each; commands and modes only of a run by stretches.
        tracker: of the outputs' extremes.
    """

    def __init__(self, flow: Flow) -> None:
        """Start where the flow is."""
        loop, data, now = flow.loop, flow.data, flow.now
        here = np.concatenate([[data.time], data.qpos, data.qvel, data.act, data.sensordata])
        self._flow, self._rough = flow, [np.zeros(0)]
        self.t, self.steps = float(data.time), 0
        self.rows, self.mode, self.u = [here[None, :]], list[np.ndarray](), list[Array]()
        if not loop.by_steps:
            self.mode, self.u = [now.mode[:1].copy()], [compute_first_command(flow.taps, flow.history, now)[None, :]]
        self.events: list[Array] = [np.empty((0, loop.width))]
        self.tracker = ExtremesTracker(data.time, loop.y(data.sensordata), self._cuts)

    def take(self) -> list[float]:
        """Take over what the flow has recorded; of that there is nothing left to take. The times of events [s]."""
        flow, record = self._flow, self._flow.record
        n_dense, n_rows, n_events, steps, n_rough, _ = (int(n) for n in record.count)
        events, dense = record.events[:n_events].copy(), record.dense[:n_dense, : 1 + flow.loop.model.nsensordata]
        self.steps += steps
        self.rows.append(record.rows[:n_rows].copy())
        self.events.append(events)
        if not flow.loop.by_steps:
            self.u.append(record.u[:n_rows].copy())
            self.mode.append(record.mode[:n_rows].copy())
        if n_rough:
            self._rough.append(record.rough[:n_rough].copy())
        self.tracker.add(dense[:, 0], flow.loop.y(dense[:, 1:]), record.event_at[:n_events])
        ends = dense if flow.loop.by_steps else self.rows[-1]
        self.t = float(ends[-1, 0]) if len(ends) else self.t
        flow.record.clear()
        return [float(t) for t in events[:, 0]]

    def _cuts(self, start: float, end: float) -> Array:
        """Times strictly between two others at which something is not smooth; no later call is of an earlier start."""
        rough = self._rough[0] if len(self._rough) == 1 else np.unique(np.concatenate(self._rough))
        rough = rough[rough > start]
        self._rough = [rough]
        return rough[rough < end]


def _verify(data: mujoco.MjData, block: Block) -> None:
    """Compare the values that the installed callbacks have just written with the matrix equations that they implement.

    Raises:
        ModelError: if they differ: the callbacks are not installed, or the code on disk is not of this version.
    """

    def waves(terms: Array, signals: Array, count: int) -> Array:
        at, amplitude, omega, phi, start, end = terms.T
        open_ = (start <= block.header[Slot.PHASE]) & (block.header[Slot.PHASE] < end)
        found = np.bincount(at.astype(int), open_ * amplitude * np.cos(omega * data.time + phi), count).astype(float)
        for place, since, _, first, last, interval in signals[signals[:, 3] < 0]:
            values = block.values[-1 - int(first) : int(last)]
            if since <= block.header[Slot.PHASE]:
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
