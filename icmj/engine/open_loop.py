"""One open-loop interval on the engine: as a function, without a recording, and its trajectory, linearised along it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller, expect_intermittent, make_layout, start_state
from icmj.engine.closed_loop import ComposedLoop, close_loop
from icmj.engine.faults import EngineFault, can_fault
from icmj.engine.flow import Flow, Log, follow
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import Schedule
from icmj.engine.stepping import make_schedule
from icmj.errors import CycleError, SimulationError
from icmj.simulation.course import Sample
from icmj.simulation.native.loop import Status
from icmj.simulation.open_loop import OpenLoopInterval, expect_one_in_flight
from icmj.simulation.settings import Settings

NEVER = 1e300  # s between rows: only events are wanted
ROWS = 200  # in an interval: what a spline through them errs by is far below what it is used for
_FEW = 90  # with fewer it is flown again
EPS = 1e-5  # half the distance of a difference; see icmj.engine.linearisation
EPS_U = 1e-4  # the same for a control, relative to its largest value on the way


class EngineOpenLoop:
    """Simulates from event to event; see :class:`icmj.simulation.open_loop.OpenLoop`. One for each thread."""

    def __init__(
        self, loop: ComposedLoop, schedule: Schedule, every: float = NEVER, like: EngineOpenLoop | None = None
    ) -> None:
        """Prepare simulations that record a row every ``every`` seconds, by default none.

        ``like`` may be one of the same model, for the same thread: they share their room.
        """
        controller = expect_intermittent(loop.controller)
        expect_one_in_flight(controller)
        self.loop, self.controller = loop, controller
        self.schedule = replace(schedule, events=1, record_interval=every)
        self.data: mujoco.MjData = mujoco.MjData(loop.model) if like is None else like.data
        self._around: list[Any] = [] if like is None else like._around
        if like is not None and (like.schedule.tolerance > 0) == (schedule.tolerance > 0):
            self._flow: Flow = like._flow.share(loop, self.schedule)
            return
        with loop.ready():
            self._flow = Flow(loop, self.data, self.schedule)

    def __call__(self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0) -> OpenLoopInterval:
        """One interval from an event at ``t``; it ends at the settings' duration if no event comes."""
        return self.recorded(x, x_o, x_h, t)[0]

    def recorded(
        self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0
    ) -> tuple[OpenLoopInterval, Array]:
        """The same, with the recorded rows (t, qpos, qvel, act, sensordata), the first at ``t``."""
        loop, data, flow = self.loop, self.data, self._flow
        hold = x_o if x_h is None else x_h
        a = start_state(self.controller, np.asarray(x_o, float), np.asarray(hold, float))
        status = Status.RUNNING
        mujoco.mj_resetData(loop.model, data)
        with loop.ready():
            loop.place(data, np.asarray(x, float), a, t)
            flow.start()
            log = Log(flow)
            while status == Status.RUNNING:
                try:
                    status = flow.advance()
                except (EngineFault, mujoco.FatalError):
                    status = Status.DIVERGED
                    flow.record.count[2] = 0
                log.take()
            rows, events = np.concatenate(log.rows), np.concatenate(log.events)
            row = events[:1] if len(events) else rows[-1:]
            outcome = None if len(events) else loop.outcome(status, log.t, data, self.schedule, np.zeros(0))
        end = loop.departures(row)
        y_max, y_min = log.tracker.result() if len(events) else (np.full((1, end.y.shape[1]), np.nan),) * 2
        length = log.t - t
        flight = OpenLoopInterval(length, end.x[0], end.x_o[0], end.x_h[0], end.y[0], y_max[-1], y_min[-1], outcome)
        return flight, rows

    def rates(self, rows: Array, moves: Array) -> Array:
        """(qvel, qacc, act_dot) at all ``rows`` (qpos, qvel, act), moved by each of ``moves``.

        Shapes (T, w), (m, w) → (T, m, 2 n_v + n_a).
        """
        from icmj.engine.native.state import neighbours_of, rates_at

        mujoco.mj_resetData(self.loop.model, self.data)
        with self.loop.ready():
            if not self._around:
                self._around.append(neighbours_of(self.loop.model, self.data))
            return rates_at(self._around[0], rows, moves, can_fault(self.loop.model))


def open_loop(plant: MujocoPlant, controller: Controller, settings: Settings, every: float = NEVER) -> EngineOpenLoop:
    """The open-loop interval of ``plant`` under ``controller``; ``settings`` give all but start and recording.

    Raises:
        ModelError: if plant and design do not fit.
        SimulationError: if a disturbance names an unknown input or output, or the timestep is not usable.
    """
    loop = close_loop(plant, controller, settings)
    return EngineOpenLoop(loop, make_schedule(loop, settings), every)


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
        return EngineOpenLoop(loop, make_schedule(loop, settings), every, first)


class EngineCourse:
    """See :class:`icmj.simulation.course.Course`."""

    def __init__(
        self, flight: EngineOpenLoop, x: Array, x_o: Array, x_h: Array, length: float, rows: Array | None = None
    ) -> None:
        """Take the ``rows`` of a stored simulation, or simulate again to the next event, about ``length`` [s] later.

        Raises:
            SimulationError: if there is none.
        """
        from scipy.interpolate import CubicSpline

        self._flight, self.loop, self.controller = flight, (loop := flight.loop), flight.controller
        self._act = loop.block.act
        a = start_state(self.controller, np.asarray(x_o, float), np.asarray(x_h, float))
        if rows is None or len(rows) < min(_FEW, length / flight.schedule.timestep):
            rows = _flown(flight, np.asarray(x, float), a, length)
        delay = self.controller.delay.t_d
        length = float(rows[-1, 0])
        self.cuts: tuple[float, ...] = (0.0, delay, length) if 0 < delay < length else (0.0, length)
        self._layout, self._controls = make_layout(self.controller), self.controller.realisation
        self._held = [(0.0, a)]  # start time and start state of each part in which the hold runs without reset
        if len(self.cuts) > 2:
            self._held.append((delay, self._controls.G @ self._free(a, np.array([delay]))[0]))
        self._ports = loop.plant.linearisation.ports
        self._nq, self._nv, self._na = loop.model.nq, loop.model.nv, loop.model.na
        splines = []
        for low, high in zip(self.cuts, self.cuts[1:], strict=False):
            here = (rows[:, 0] >= low - 1e-12) & (rows[:, 0] <= high + 1e-12)
            t, values = np.clip(rows[here, 0], low, high), rows[here, 1:]
            kept = np.concatenate([[True], np.diff(t) > 1e-12])
            thin = max(len(t) // ROWS, 1)
            kept[1:-1] &= np.arange(1, len(t) - 1) % thin == 0
            splines.append(CubicSpline(t[kept], values[kept]))
        self._splines = splines
        last = self._whole(np.array([length]), len(splines) - 1)[:, : self._nq + self._nv + self._na]
        self.rate = self._rates(last, np.zeros((1, last.shape[1])))[0, 0]

    def _free(self, a: Array, tau: Array) -> Array:
        """The controller's state at times ``tau`` into a part: the hold in closed form, the observer unchanged."""
        after, h = np.tile(a, (len(tau), 1)), self._layout["x_h"]
        after[:, h] = self.controller.hold.free(a[h], tau)
        return after

    def _whole(self, t: Array, part: int) -> Array:
        """Rows (qpos, qvel, act, sensordata) at times within a part."""
        rows = self._splines[part](t)
        start, a = self._held[part]
        free = self._free(a, t - start)
        first = self._nq + self._nv + self._act.start
        o = self._layout["x_o"]
        free[:, o] = rows[:, first + o.start : first + o.stop]
        rows[:, first : first + free.shape[1]] = free
        return rows

    def sample(self, t: Array) -> Sample:
        """Its states at given times."""
        loop, last = self.loop, len(self._splines) - 1
        parts = np.clip(np.searchsorted(np.array(self.cuts), t, side="right") - 1, 0, last)
        rows = np.concatenate([self._whole(t[parts == part], part) for part in range(len(self._splines))])
        at = loop.departures(np.hstack([t[:, None], rows]))
        u = -at.x_h @ self.controller.design.k.T
        return Sample(t, at.x, at.x_o, at.x_h, at.y, u, rows[:, : self._nq])

    def generators(self, t: Array, part: int) -> Array:
        """F by centred differences of the closed loop's right-hand side.

        Raises:
            CycleError: if joints turn freely in space, whose positions do not depart as their velocities do.
        """
        if self._nq != self._nv:
            raise CycleError("the equation of variation is written for joints that turn about one axis, and slides")
        kept, K = self._ports.states, self._controls.K
        n, size = len(kept), len(kept) + K.shape[1]
        rows = self._whole(t, part)[:, : self._nq + self._nv + self._na]
        first = self._nq + self._nv + self._act.start
        u = rows[:, first : first + K.shape[1]] @ K.T
        reach = EPS_U * np.maximum(np.abs(u).max(axis=0), 1e-6 * max(float(np.abs(u).max()), 1e-300))
        # moves: along each state, and along directions of a that move one input each
        moves = np.zeros((n + len(reach), rows.shape[1]))
        moves[np.arange(n), kept] = EPS
        moves[n:, first : first + K.shape[1]] = (np.linalg.pinv(K) * reach).T
        ends = self._rates(rows, np.stack([moves, -moves], axis=1).reshape(-1, rows.shape[1]))
        slopes = (ends[:, 0::2] - ends[:, 1::2]) / (2 * np.append(np.full(n, EPS), reach))[:, None]
        F = np.zeros((len(t), size, size))
        F[:, :, :n] = slopes[:, :n].transpose(0, 2, 1)
        F[:, :n, n:] = np.einsum("tij,ik->tjk", slopes[:, n:, :n], K)
        F[:, n:, n:] = self._controls.M
        return F

    def _rates(self, rows: Array, moves: Array) -> Array:
        """d/dt of (x, a) at all ``rows``, moved by each of ``moves``; shapes (T, w), (m, w) → (T, m, n + N_a)."""
        rates = self._flight.rates(rows, moves)
        x, a = rates[..., : 2 * self._nv + self._act.start], rates[..., 2 * self._nv :]
        return np.concatenate([self._ports.reduce(x), a[..., self._act]], axis=-1)


def _flown(flight: EngineOpenLoop, x: Array, a: Array, length: float) -> Array:
    every = length / ROWS if flight.schedule.tolerance else max(length / ROWS, flight.schedule.timestep)
    record = follow(flight.loop, flight.loop.data(x, a), replace(flight.schedule, events=1, record_interval=every))
    if len(record.events) != 1:
        raise SimulationError(f"the interval {record.outcome.message}, without an event at its end")
    return record.rows
