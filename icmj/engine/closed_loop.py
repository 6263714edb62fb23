"""A composed model (plant and controller) that can be started and simulated."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.signals import unhurried
from icmj.controller.controller import Controller
from icmj.engine.block import Block, block_of, numbers_of
from icmj.engine.callbacks import installed
from icmj.engine.composition import compose, repack, standing
from icmj.engine.extremes import POINTS, POINTS_ADAPTIVE, ExtremesTracker
from icmj.engine.fault import EngineFault, words
from icmj.engine.model import depart, state_names
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import Schedule, States, Status, phases_of, recording
from icmj.engine.tableau import fastest_rate, is_stiff
from icmj.engine.units import state_units
from icmj.simulation import ending
from icmj.simulation.disturbance import Acting, Disturbance, Pushes, acting_on
from icmj.simulation.ending import Outcome
from icmj.simulation.gaussian import points_between
from icmj.simulation.settings import Settings

if TYPE_CHECKING:
    from icmj.engine.native.loop import FixedLoop

COLLAPSED = (
    "no step is short enough for the tolerance: the motion is not smooth here; give [simulation] a timestep, with "
    "which one of MuJoCo's integrators steps"
)
CHUNK = 2000  # steps between two looks at the keyboard and the progress bar


@dataclass(frozen=True, eq=False)
class Record:
    """The record of a run.

    Attributes:
        rows, events: rows (t, qpos, qvel, act, sensordata), shapes (N, width), (K, width).
        y_max, y_min: extremes of the outputs (departures) over the interval before each event, shapes (K, n_y).
        steps: steps taken.
        outcome: how it ended.
    """

    rows: Array
    events: Array
    y_max: Array
    y_min: Array
    steps: int
    outcome: Outcome


@dataclass(frozen=True, eq=False)
class ComposedLoop:
    """Plant and controller in one model. A run changes ``model.opt.timestep``: use one for each thread.

    Attributes:
        plant, controller: what it was composed of.
        disturbance: beside the plant's commands.
        errors: of its outputs as the observer reads them.
        pushes: on the plant itself.
        model: the composed model.
        numbers: the controller's own, where the model is another loop's and holds that one's between runs.
    """

    plant: MujocoPlant
    controller: Controller
    disturbance: Disturbance
    errors: Disturbance
    pushes: Pushes
    model: mujoco.MjModel
    numbers: Array | None = None

    @cached_property
    def block(self) -> Block:
        """The controller in the form that the model contains."""
        block = block_of(self.model)
        assert block is not None
        return block

    def again(self, plant: MujocoPlant, controller: Controller, settings: Settings) -> ComposedLoop | None:
        """Like :func:`close_loop`, but sharing its model, which it writes to in its runs; only for the same thread.

        Returns:
            the loop, or ``None`` where its model has to be another.

        Raises:
            ModelError, SimulationError: as there.
        """
        if plant.spec is not self.plant.spec or integrator_of(plant, settings) != self.model.opt.integrator:
            return None
        acting = acting_on(plant.linearisation.plant, settings, controller)
        numbers = repack(self.model, plant, controller, *acting, settings.duration)
        if numbers is None:
            return None
        return ComposedLoop(plant, controller, *acting, self.model, numbers)

    def data(self, x: Array, a: Array, t: float = 0.0) -> mujoco.MjData:
        """Engine data at a state of plant and controller; see :meth:`place`."""
        data = mujoco.MjData(self.model)
        self.place(data, x, a, t)
        return data

    def place(self, data: mujoco.MjData, x: Array, a: Array, t: float = 0.0) -> None:
        """Set the plant's deviation from the operating point and the controller's state."""
        here = self.plant.linearisation
        data.time = t
        depart(self.model, data, here.point, here.ports.whole(x))
        data.act[self.block.act] = a

    @property
    def acting(self) -> Acting:
        """All exogenous inputs."""
        return Acting(self.disturbance, self.errors, self.pushes)

    def schedule(self, settings: Settings, timestep: float, tolerance: float = 0.0) -> Schedule:
        """The times of a run with these settings, by a timestep or, where it is not 0, a tolerance.

        Raises:
            SimulationError: if a limit names what is no position.
        """
        trigger = self.controller.trigger
        # noise may be faster than the loop, and shakes E
        plant = self.plant.linearisation.plant
        own = fastest_rate(plant, self.controller)
        edges = points_between(self.acting.edges, self.acting.gaussian, settings.duration)
        return Schedule(
            timestep=timestep,
            tolerance=tolerance,
            t_end=settings.duration,
            delta_min=max(trigger.delta_min - self.controller.sampling_delay, 0.0),
            clock=trigger.clock,
            delay=self.controller.delay.t_d,
            edges=edges,
            phases=phases_of(edges),
            record_interval=settings.record_interval,
            limits=self.plant.limits(settings.limit),
            rate=max(own, float(self.acting.omega.max(initial=0.0))),
            stiff=is_stiff(plant, own),
            sampling=self.controller.sampling_delay,
        )

    def stepper(self, data: mujoco.MjData, schedule: Schedule) -> FixedLoop:
        """A stepper of the model from event to event, from the state in ``data``; within :meth:`ready`."""
        qpos = self.plant.linearisation.point.qpos
        if schedule.tolerance > 0:
            from icmj.engine.native.adaptive_loop import AdaptiveLoop

            return AdaptiveLoop(self.model, data, schedule, qpos)
        from icmj.engine.native.loop import FixedLoop

        return FixedLoop(self.model, data, schedule, qpos)

    def tracker(self, data: mujoco.MjData, schedule: Schedule) -> ExtremesTracker:
        """The object that finds the extremes of the outputs of a run from ``data``."""
        points = POINTS_ADAPTIVE if schedule.tolerance > 0 else POINTS
        return ExtremesTracker(data.time, self.y(data.sensordata), schedule.jumps, points)

    def run(self, data: mujoco.MjData, schedule: Schedule, progress: Callable[[float], None] | None = None) -> Record:
        """Run from ``data`` until the schedule's end or until the plant falls or diverges, or the user interrupts."""
        model, width = self.model, self.width
        record = recording(CHUNK, model.nsensordata, width)
        status, steps, stopped, t = Status.RUNNING, 0, False, data.time
        fault, pace, crowded = "", ending.EventPace(schedule.t_end), None
        with self.ready():
            loop = self.stepper(data, schedule)
            first = np.concatenate([[t], data.qpos, data.qvel, data.act, data.sensordata])
            rows, events = [first[None, :]], [np.empty((0, width))]
            tracker = self.tracker(data, schedule)

            def keep() -> None:
                """Take over what the last steps recorded; of steps taken over there is nothing left to take."""
                nonlocal steps, t, crowded
                with unhurried():
                    n_dense, n_rows, n_events, taken = (int(n) for n in record.count)
                    steps += taken
                    rows.append(record.rows[:n_rows].copy())
                    events.append(record.events[:n_events].copy())
                    dense = record.dense[:n_dense]
                    tracker.add(dense[:, 0], self.y(dense[:, 1:]), record.event_at[:n_events])
                    t = float(dense[-1, 0]) if n_dense else t
                    crowded = pace.stalled(*record.events[:n_events, 0].tolist())
                    record.clear()

            try:
                while status == Status.RUNNING and crowded is None:
                    try:
                        status = loop.advance(record, CHUNK)
                    except (EngineFault, mujoco.FatalError) as error:  # what was simulated before stays
                        fault = str(error) if isinstance(error, EngineFault) else words(error)
                        status = Status.DIVERGED
                    keep()
                    if progress is not None:
                        progress(min(data.time / schedule.t_end, 1.0))
            except KeyboardInterrupt:
                stopped = True
                keep()
                if not steps:  # there is nothing to keep; it may have been compiling
                    raise
        at_events = np.concatenate(events)
        y_max, y_min = tracker.result()
        outcome = self.outcome(Status.RUNNING if stopped else status, t, data, schedule, at_events[:, 0])
        if fault:
            outcome = ending.diverged(t, fault)
        elif crowded is not None and status == Status.RUNNING and not stopped:
            outcome = ending.stalled(t, crowded)
        return Record(np.concatenate(rows), at_events, y_max, y_min, steps, outcome)

    @property
    def width(self) -> int:
        """Length of a row (t, qpos, qvel, act, sensordata)."""
        model = self.model
        return int(1 + model.nq + model.nv + model.na + model.nsensordata)

    def outcome(self, status: Status, t: float, data: mujoco.MjData, schedule: Schedule, events: Array) -> Outcome:
        """The outcome, from the loop's return code; ``RUNNING`` means that the run was interrupted."""
        if status == Status.RUNNING:
            return ending.interrupted(t, schedule.t_end)
        if status == Status.FELL:
            departure = np.zeros(self.model.nv)
            mujoco.mj_differentiatePos(self.model, departure, 1.0, self.plant.linearisation.point.qpos, data.qpos)
            at = int(np.argmax(np.abs(departure) / schedule.limits))
            return ending.fell(t, state_names(self.model)[at], schedule.limits[at], state_units(self.model)[at])
        if status == Status.DIVERGED:
            return ending.diverged(t, "the state stopped being finite")
        if status == Status.COLLAPSED:
            return ending.diverged(t, COLLAPSED)
        if status == Status.WARNED:
            names = [mujoco.mjtWarning(i).name for i, w in enumerate(data.warning) if w.number]
            return ending.diverged(t, f"the engine warned ({', '.join(names)})")
        return ending.ran(t, np.diff(events, prepend=0.0), self.controller.least)

    @contextmanager
    def ready(self) -> Iterator[None]:
        """The callbacks installed and this controller in the model; on leaving all is put back that a run changes."""
        from icmj.engine.native.callbacks import callbacks

        timestep, here = self.model.opt.timestep, numbers_of(self.model)
        held = here.copy()
        if self.numbers is not None:
            here[:] = self.numbers
        try:
            with installed(*callbacks()):
                yield
        finally:
            self.model.opt.timestep = timestep
            here[:] = held

    def departures(self, rows: Array) -> States:
        """Recorded rows as departures from the operating point."""
        point = self.plant.linearisation.point
        nq, nv, na = len(point.qpos), len(point.qvel), len(point.act)
        layout = standing(self.controller).real.layout
        qpos, qvel, act, a, y = np.split(rows[:, 1:], np.cumsum([nq, nv, na, layout.size]), axis=1)
        position = np.zeros((len(rows), nv))
        if nq == nv:
            position = qpos - point.qpos
        else:
            for departure, q in zip(position, qpos, strict=True):
                mujoco.mj_differentiatePos(self.model, departure, 1.0, point.qpos, np.ascontiguousarray(q))
        x, parts = np.hstack([position, qvel - point.qvel, act - point.act]), layout.split(a)
        kept = self.plant.linearisation.ports.states
        return States(x[:, kept], parts["x_o"], parts["x_h"], self.y(y))

    def y(self, sensordata: Array) -> Array:
        """The readings of the controller, as deviations from the operating point, shape (..., n_y)."""
        ports = self.plant.linearisation.ports
        return ports.read(sensordata) + ports.beta - self.plant.linearisation.y


def close_loop(plant: MujocoPlant, controller: Controller, settings: Settings) -> ComposedLoop:
    """Compose plant and controller, with the disturbance and integrator that ``settings`` name.

    Raises:
        ModelError: if plant and design do not fit; see :func:`icmj.engine.composition.compose`.
        SimulationError: if a disturbance names an unknown input, output or body.
    """
    acting = acting_on(plant.linearisation.plant, settings, controller)
    model = compose(plant, controller, *acting, settings.duration)
    model.opt.integrator = integrator_of(plant, settings)
    return ComposedLoop(plant, controller, *acting, model)


def integrator_of(plant: MujocoPlant, settings: Settings) -> int:
    """The number of the integrator that the settings name, or the model's own."""
    if settings.integrator is None:
        return int(plant.spec.option.integrator)
    return int(getattr(mujoco.mjtIntegrator, f"mjINT_{settings.integrator.upper()}"))
