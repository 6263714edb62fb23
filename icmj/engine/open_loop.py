"""One open-loop interval on the engine as a function, without a recording."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller, start_state
from icmj.engine.closed_loop import CHUNK, ComposedLoop, close_loop
from icmj.engine.fault import EngineFault, can_fault
from icmj.engine.plant import MujocoPlant
from icmj.engine.recording import Recording, Status, recording
from icmj.engine.schedule import Schedule
from icmj.engine.stepping import schedule_of
from icmj.simulation.interval import OpenLoopInterval, one_in_flight
from icmj.simulation.settings import Settings

if TYPE_CHECKING:
    from icmj.engine.native.loop import FixedLoop

NEVER = 1e300  # s between rows: only events are wanted


class EngineOpenLoop:
    """Simulates from event to event; see :class:`icmj.simulation.interval.OpenLoop`. One for each thread."""

    def __init__(
        self, loop: ComposedLoop, schedule: Schedule, every: float = NEVER, like: EngineOpenLoop | None = None
    ) -> None:
        """Prepare simulations that record a row every ``every`` seconds, by default none.

        ``like`` may be one of the same model, for the same thread: they share their room.
        """
        one_in_flight(loop.controller)
        self.loop = loop
        self.schedule = replace(schedule, events=1, record_interval=every)
        self.data: mujoco.MjData = mujoco.MjData(loop.model) if like is None else like.data
        self._record: Recording = recording(CHUNK, loop.model.nsensordata, loop.width) if like is None else like._record
        self._around: list[Any] = [] if like is None else like._around
        if like is not None and _method(like.schedule) == _method(schedule):
            self._steps: FixedLoop = like._steps.rescheduled(self.schedule, loop.plant.linearisation.point.qpos)
            return
        with loop.ready():
            self._steps = loop.stepper(self.data, self.schedule)

    def __call__(self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0) -> OpenLoopInterval:
        """One interval from an event at ``t``; it ends at the settings' duration if no event comes."""
        return self.recorded(x, x_o, x_h, t)[0]

    def recorded(
        self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0
    ) -> tuple[OpenLoopInterval, Array]:
        """The same, with the recorded rows (t, qpos, qvel, act, sensordata), the first at ``t``."""
        loop, data, record = self.loop, self.data, self._record
        hold = x_o if x_h is None else x_h
        a = start_state(loop.controller, np.asarray(x_o, float), np.asarray(hold, float))
        status, last = Status.RUNNING, t
        mujoco.mj_resetData(loop.model, data)
        with loop.ready():
            loop.place(data, np.asarray(x, float), a, t)
            self._steps.begin()
            rows = [np.concatenate([[t], data.qpos, data.qvel, data.act, data.sensordata])[None, :]]
            tracker = loop.tracker(data, self.schedule)
            while status == Status.RUNNING:
                record.clear()
                try:
                    status = self._steps.advance(record, CHUNK)
                except (EngineFault, mujoco.FatalError):
                    status = Status.DIVERGED
                    record.count[2] = 0
                n_dense, n_rows, n_events, _ = (int(n) for n in record.count)
                tracker.add(record.dense[:n_dense, 0], loop.y(record.dense[:n_dense, 1:]), record.event_at[:n_events])
                rows.append(record.rows[:n_rows].copy())
                last = float(record.dense[n_dense - 1, 0]) if n_dense else last
            row = record.events[0] if n_events else record.rows[max(n_rows, 1) - 1]
            if not n_events and not n_rows:  # there was no time to fly
                row = rows[0][0]
            outcome = None if n_events else loop.outcome(status, last, data, self.schedule, np.zeros(0))
        end = loop.departures(row[None, :].copy())
        y_max, y_min = tracker.result() if n_events else (np.full((1, end.y.shape[1]), np.nan),) * 2
        flight = OpenLoopInterval(last - t, end.x[0], end.x_o[0], end.x_h[0], end.y[0], y_max[-1], y_min[-1], outcome)
        return flight, np.concatenate(rows)

    def rates(self, rows: Array, moves: Array) -> Array:
        """(qvel, qacc, act_dot) at all ``rows`` (qpos, qvel, act), moved by each of ``moves``.

        Shapes (T, w), (m, w) → (T, m, 2 n_v + n_a).
        """
        from icmj.engine.native.neighbours import neighbours_of, rates_at

        mujoco.mj_resetData(self.loop.model, self.data)
        with self.loop.ready():
            if not self._around:
                self._around.append(neighbours_of(self.loop.model, self.data))
            return rates_at(self._around[0], rows, moves, can_fault(self.loop.model))


def _method(schedule: Schedule) -> tuple[int, float] | None:
    return (schedule.method.order, schedule.method.allowed) if schedule.tolerance else None


def open_loop(plant: MujocoPlant, controller: Controller, settings: Settings, every: float = NEVER) -> EngineOpenLoop:
    """The open-loop interval of ``plant`` under ``controller``; ``settings`` give all but start and recording.

    Raises:
        ModelError: if plant and design do not fit.
        SimulationError: if a disturbance names an unknown input or output, or the timestep is not usable.
    """
    loop = close_loop(plant, controller, settings)
    return EngineOpenLoop(loop, schedule_of(loop, settings), every)


class OpenLoops:
    """Makes open loops one after another and reuses the parts that have not changed; for one thread."""

    def __init__(self) -> None:
        self._first: EngineOpenLoop | None = None

    def __call__(
        self, plant: MujocoPlant, controller: Controller, settings: Settings, every: float = NEVER
    ) -> EngineOpenLoop:
        """See :func:`open_loop`."""
        first = self._first
        loop = None if first is None else first.loop.again(plant, controller, settings)
        if first is None or loop is None:
            self._first = open_loop(plant, controller, settings, every)
            return self._first
        return EngineOpenLoop(loop, schedule_of(loop, settings), every, first)
