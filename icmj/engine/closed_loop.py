"""A composed model that can be started and run: rows of numbers in, rows of numbers out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np

from icmj.controller import ClockTrigger, Controller, EventTrigger
from icmj.disturbance import Disturbance
from icmj.engine import reference
from icmj.engine.callbacks import installed
from icmj.engine.composition import Slot, block_of, compose
from icmj.engine.extremes import ExtremesTracker, Find, extremes
from icmj.engine.plant import MujocoPlant
from icmj.engine.recording import Recording, Status, recording
from icmj.engine.schedule import Schedule, phases_of
from icmj.linear_plant import Array
from icmj.runfile import SimulationSettings
from icmj.simulation import Outcome
from icmj.theory.error_system import error_system

CHUNK = 2000  # steps between two looks at the keyboard and the progress bar


class Loop(Protocol):
    """Steps a composed model; see :class:`icmj.engine.reference.ReferenceLoop`."""

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, writing into ``record``."""


@dataclass(frozen=True, eq=False)
class States:
    """Rows as departures from the operating point, shapes (N, ...)."""

    x: Array
    x_o: Array
    x_h: Array
    y: Array


@dataclass(frozen=True, eq=False)
class Rows:
    """What a run recorded.

    Attributes:
        samples, events: rows (t, qpos, qvel, act, sensordata), shapes (N, width), (K, width).
        y_max, y_min: extremes of the outputs (departures) over the interval before each event, shapes (K, n_y).
        steps: steps taken.
        outcome: how it ended.
    """

    samples: Array
    events: Array
    y_max: Array
    y_min: Array
    steps: int
    outcome: Outcome


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Plant and controller in one model. A run changes ``model.opt.timestep``: use one for each thread.

    Attributes:
        plant, controller: what it was composed of.
        disturbance: on the plant's inputs.
        model: the composed model.
        native: whether runs use the compiled callbacks and loop, or the plain-Python ones.
    """

    plant: MujocoPlant
    controller: Controller
    disturbance: Disturbance
    model: mujoco.MjModel
    native: bool

    def start(self, x: Array, x_o: Array, x_h: Array, t: float = 0.0) -> mujoco.MjData:
        """Engine data at the state given as departures from the operating point."""
        point, nv, block = self.plant.linearisation.point, self.model.nv, block_of(self.model)
        assert block is not None
        data = mujoco.MjData(self.model)
        data.time = t
        data.qpos[:] = point.qpos
        mujoco.mj_integratePos(self.model, data.qpos, np.ascontiguousarray(x[:nv]), 1.0)
        data.qvel[:] = point.qvel + x[nv : 2 * nv]
        data.act[: block.act.start] = point.act + x[2 * nv :]
        data.act[block.act] = np.concatenate([x_o, x_h])
        return data

    def schedule(self, settings: SimulationSettings, timestep: float) -> Schedule:
        """The times of a run with these settings."""
        trigger, design = self.controller.trigger, self.controller.design
        A_C = error_system(self.plant.linearisation.plant, design, self.controller.hold).A_C
        return Schedule(
            timestep=timestep,
            t_end=settings.duration,
            delta_min=trigger.delta_min if isinstance(trigger, EventTrigger) else 0.0,
            clock=trigger.interval if isinstance(trigger, ClockTrigger) else np.inf,
            edges=self.disturbance.edges,
            phases=phases_of(self.disturbance.edges),
            record_interval=settings.record_interval,
            limit=settings.limit,
            rate=float(np.abs(np.linalg.eigvals(A_C)).max()),
        )

    def run(self, data: mujoco.MjData, schedule: Schedule, progress: Callable[[float], None] | None = None) -> Rows:
        """Run from ``data`` until the schedule's end or until the plant falls or diverges, or the user interrupts."""
        model, point = self.model, self.plant.linearisation.point
        y_0 = self.plant.linearisation.y
        width = 1 + model.nq + model.nv + model.na + model.nsensordata
        record = recording(CHUNK, model.nsensordata, width)
        make, control, act_dyn, find = _implementation(self.native)
        status, steps, interrupted, t = Status.RUNNING, 0, False, data.time
        with installed(control, act_dyn), self._lent():
            loop: Loop = make(model, data, schedule, point.qpos)
            first = np.concatenate([[t], data.qpos, data.qvel, data.act, data.sensordata])
            samples, events = [first[None, :]], [np.empty((0, width))]
            tracker = ExtremesTracker(t, data.sensordata - y_0, schedule.edges, find)
            while status == Status.RUNNING and not interrupted:
                record.clear()
                try:
                    status = loop.advance(record, CHUNK)
                    if progress is not None:
                        progress(min(data.time / schedule.t_end, 1.0))
                except KeyboardInterrupt:
                    interrupted = True
                n_dense, n_samples, n_events = (int(n) for n in record.count)
                steps += n_dense
                samples.append(record.samples[:n_samples].copy())
                events.append(record.events[:n_events].copy())
                dense = record.dense[:n_dense]
                tracker.add(dense[:, 0], dense[:, 1:] - y_0, record.event_at[:n_events])
                t = float(dense[-1, 0]) if n_dense else t
        at_events = np.concatenate(events)
        y_max, y_min = tracker.result()
        outcome = self._outcome(Status.RUNNING if interrupted else status, t, data, schedule, at_events[:, 0])
        return Rows(np.concatenate(samples), at_events, y_max, y_min, steps, outcome)

    def _outcome(self, status: Status, t: float, data: mujoco.MjData, schedule: Schedule, events: Array) -> Outcome:
        if status == Status.RUNNING:
            return Outcome("interrupted", t, f"was interrupted at {t:.6g} s of {schedule.t_end:g} s")
        if status == Status.FELL:
            departure = np.zeros(self.model.nv)
            mujoco.mj_differentiatePos(self.model, departure, 1.0, self.plant.linearisation.point.qpos, data.qpos)
            name = self.plant.linearisation.plant.states[int(np.argmax(np.abs(departure)))]
            return Outcome(
                "fell", t, f"fell at {t:.6g} s: {name} departed further than its limit of {schedule.limit:g}"
            )
        if status == Status.DIVERGED:
            return Outcome("diverged", t, f"diverged at {t:.6g} s: the state stopped being finite")
        if status == Status.WARNED:
            names = [mujoco.mjtWarning(i).name for i, w in enumerate(data.warning) if w.number]
            return Outcome("diverged", t, f"diverged at {t:.6g} s: the engine warned ({', '.join(names)})")
        late = np.diff(events, prepend=0.0)[-20:]
        if len(late) == 20 and schedule.delta_min > 0 and (late <= schedule.delta_min * (1 + 1e-6)).all():
            return Outcome("sliding", t, f"slid: the last intervals all collapsed to Δ_min = {schedule.delta_min:g} s")
        return Outcome("completed", t, f"ran to {t:g} s")

    @contextmanager
    def _lent(self) -> Iterator[None]:
        """Put back on leaving what a loop changes in the model."""
        timestep, block = self.model.opt.timestep, block_of(self.model)
        assert block is not None
        phase = block.header[Slot.PHASE]
        try:
            yield
        finally:
            self.model.opt.timestep = timestep
            block.header[Slot.PHASE] = phase

    def departures(self, rows: Array) -> States:
        """Recorded rows as departures from the operating point."""
        point, n = self.plant.linearisation.point, self.controller.design.plant.n
        nq, nv, na = len(point.qpos), len(point.qvel), len(point.act)
        qpos, qvel, act, x_o, x_h, y = np.split(rows[:, 1:], np.cumsum([nq, nv, na, n, n]), axis=1)
        position = np.zeros((len(rows), nv))
        if nq == nv:
            position = qpos - point.qpos
        else:
            for departure, q in zip(position, qpos, strict=True):
                mujoco.mj_differentiatePos(self.model, departure, 1.0, point.qpos, np.ascontiguousarray(q))
        x = np.hstack([position, qvel - point.qvel, act - point.act])
        return States(x, x_o, x_h, y - self.plant.linearisation.y)


def close_loop(
    plant: MujocoPlant,
    controller: Controller,
    disturbance: Disturbance,
    integrator: str | None = None,
    native: bool = True,
) -> ClosedLoop:
    """Compose plant and controller; an ``integrator`` of ``None`` is the model's.

    Raises:
        ModelError: if plant and design do not fit; see :func:`icmj.engine.composition.compose`.
    """
    model = compose(plant, controller, disturbance)
    if integrator is not None:
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    return ClosedLoop(plant, controller, disturbance, model, native)


def _implementation(native: bool) -> tuple[Any, Any, Any, Find]:
    """The loop's class, the callbacks that go with it, and what finds extremes."""
    if native:
        from icmj.engine.native_callbacks import callbacks
        from icmj.engine.native_extremes import extremes as compiled_extremes
        from icmj.engine.native_loop import NativeLoop

        return NativeLoop, *callbacks(), compiled_extremes
    return reference.ReferenceLoop, reference.control, reference.act_dyn, extremes
