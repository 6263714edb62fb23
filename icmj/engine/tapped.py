"""A controller that reads delayed outputs, on the engine: stretches in which its command is known ahead.

Over a stretch (:mod:`icmj.simulation.native.taps`) the engine integrates under a command that is a polynomial in time,
as it would under any other input. What it wrote down of the outputs, at every step or within adaptive steps, is made a
polynomial again for the taps: by splines of degree seven, of a higher order than any of the integrators.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import called
from icmj.base.signals import unhurried
from icmj.controller.law import Law
from icmj.engine.block import Slot
from icmj.engine.closed_loop import CHUNK, ComposedLoop, Record, integrator_of
from icmj.engine.composition import compose
from icmj.engine.extremes import POINTS, POINTS_ADAPTIVE, ExtremesTracker
from icmj.engine.fault import EngineFault, words
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import Schedule, Status, phases_of, recording
from icmj.engine.tableau import fastest_rate, is_stiff
from icmj.simulation import ending
from icmj.simulation.disturbance import acting_on
from icmj.simulation.gaussian import points_between
from icmj.simulation.native.taps import ROUGH, SAME, SMOOTH, entries
from icmj.simulation.settings import LEAST_TOLERANCE, Settings
from icmj.simulation.taps import History, Now, Taps, begun, first_command, first_level, levels_of, taps_of, widened

if TYPE_CHECKING:
    from icmj.engine.native.loop import FixedLoop

_DEGREE = 7  # of the splines
_LEAST = 8  # steps of a stretch, or looks at the outputs within a step, as many as such a spline takes
_SWING = 3.0  # rad of a sinusoid that the polynomial of a stretch takes in: to 1e-11 of it
_SHORT = 1e-6  # s; what stretches of that length do is straight


@dataclass(eq=False)
class Stand:
    """The progress of a run apart from the engine's state, from which it can be continued again.

    Attributes:
        t: now [s].
        history, now: of the controller.
        level: of what begins now.
        edge: number of the next edge of a disturbance.
        row: number of the next row among the multiples of the interval between rows.
        state: (qpos, qvel, act) of the engine.
    """

    t: float
    history: History
    now: Now
    level: int
    edge: int
    row: int
    state: tuple[Array, Array, Array]

    def copy(self, data: mujoco.MjData) -> Stand:
        """A copy of the present progress, with the engine's state."""
        state = data.qpos.copy(), data.qvel.copy(), data.act.copy()
        return replace(self, history=deepcopy(self.history), now=deepcopy(self.now), state=state)


@dataclass(frozen=True, eq=False)
class TappedRecord(Record):
    """The record of a run.

    Attributes:
        u, mode: command and mode at the rows, shapes (N, n_u), (N,).
        stand: a while before the end, to repeat what came after.
    """

    u: Array
    mode: Array
    stand: Stand


@dataclass(frozen=True, eq=False)
class TappedLoop(ComposedLoop):
    """Plant and a controller that reads delayed outputs, in one model."""

    controller: Law  # type: ignore[assignment]

    @property
    def noise(self) -> float:
        """The fastest sinusoid that acts on it [rad/s]."""
        return max(
            float(omega.max(initial=0.0)) for omega in (self.acting.omega, self.controller.realisation.signals[:, 2])
        )

    def schedule(self, settings: Settings, timestep: float, tolerance: float = 0.0) -> Schedule:
        """The times of a run with these settings; see :meth:`icmj.engine.closed_loop.ComposedLoop.schedule`."""
        edges = points_between(self.acting.edges, self.acting.gaussian, settings.duration)
        plant = self.plant.linearisation.plant
        own = fastest_rate(plant, self.controller)
        # what errs comes back through the taps
        tolerance = max(tolerance / 10, LEAST_TOLERANCE) if tolerance else 0.0
        return Schedule(
            timestep=timestep, tolerance=tolerance, t_end=settings.duration, delta_min=0.0, clock=np.inf, delay=0.0,
            edges=edges, phases=phases_of(edges), record_interval=settings.record_interval,
            limits=self.plant.limits(settings.limit), rate=max(own, self.noise), stiff=is_stiff(plant, own),
        )  # fmt: skip

    def outcome(
        self, status: Status, t: float, data: mujoco.MjData, schedule: Schedule, events: Array
    ) -> ending.Outcome:
        """The outcome, from the loop's return code."""
        if status == Status.COMPLETED:
            return ending.ran(t, np.zeros(0), 0.0)
        return super().outcome(status, t, data, schedule, events)

    def run(
        self,
        data: mujoco.MjData,
        schedule: Schedule,
        progress: Callable[[float], None] | None = None,
        stand: Stand | None = None,
    ) -> TappedRecord:
        """Run from ``data``, which are at the run's begin or at a ``stand``, until the schedule's end or another."""
        from icmj.engine.native.adaptive_loop import AdaptiveLoop

        run = _Run(self, data, schedule, stand)
        status, stopped, fault, crowded = Status.RUNNING, False, "", None
        pace, every = ending.EventPace(schedule.t_end), max(1.0, 3 * self.controller.realisation.taps[-1])
        stands = [run.stand.copy(data)] * 2
        with self.ready():
            stepper = self.stepper(data, schedule)
            if isinstance(stepper, AdaptiveLoop):
                stepper.look(_LEAST)
            try:
                while status == Status.RUNNING and crowded is None:
                    if run.stand.t >= stands[-1].t + every:
                        stands = [stands[-1], run.stand.copy(data)]
                    try:
                        status, switched = run.stretch(stepper)
                    except (EngineFault, mujoco.FatalError) as error:  # what was simulated before stays
                        fault = str(error) if isinstance(error, EngineFault) else words(error)
                        status, switched = Status.DIVERGED, False
                    if switched:
                        crowded = pace.stalled(run.stand.t)
                    if progress is not None:
                        progress(min(data.time / schedule.t_end, 1.0))
            except KeyboardInterrupt:
                stopped = True
                if not run.steps:  # there is nothing to keep; it may have been compiling
                    raise
        rows, events = np.concatenate(run.rows), np.concatenate(run.events)
        t = float(rows[-1, 0])
        outcome = self.outcome(Status.RUNNING if stopped else status, t, data, schedule, events[:, 0])
        if fault:
            outcome = ending.diverged(t, fault)
        elif crowded is not None and status == Status.RUNNING and not stopped:
            outcome = ending.stalled(t, crowded)
        y_max, y_min = run.tracker.result()
        u, mode = np.concatenate(run.u), np.concatenate(run.mode)
        return TappedRecord(rows, events, y_max, y_min, run.steps, outcome, u, mode, stands[0])


def close_tapped(plant: MujocoPlant, law: Law, settings: Settings) -> TappedLoop:
    """Compose plant and controller; errors of the readings stay outside the model.

    Raises:
        ModelError, SimulationError: as for :func:`icmj.engine.closed_loop.close_loop`.
    """
    acting, errors, pushes = acting_on(plant.linearisation.plant, settings)
    model = compose(plant, law, acting, None, pushes, settings.duration)
    model.opt.integrator = integrator_of(plant, settings)
    return TappedLoop(plant, law, acting, errors, pushes, model)


class _Run:
    """A run in progress with its record."""

    def __init__(self, loop: TappedLoop, data: mujoco.MjData, schedule: Schedule, stand: Stand | None) -> None:
        realisation = loop.controller.realisation
        self.loop, self.data, self.schedule = loop, data, schedule
        # of a step that is a whole stretch the dense output is coarser than its end, from which its length follows
        own = 2 * max(fastest_rate(loop.plant.linearisation.plant, loop.controller), 1 / realisation.taps[0])
        n_y, rate = loop.controller.plant.n_y, max(own, loop.noise / _SWING)
        self.taps: Taps = taps_of(realisation, n_y, rate, exact=False)
        mujoco.mj_forward(loop.model, data)
        here = np.concatenate([[data.time], data.qpos, data.qvel, data.act, data.sensordata])
        y = loop.y(data.sensordata)
        if stand is None:
            history, now = begun(self.taps, realisation, y + loop.errors(0.0))
            stand = Stand(0.0, history, now, first_level(realisation), 0, 1, (here[:0],) * 3)
        self.stand = stand
        self.levels = levels_of(schedule.edges, loop.acting)
        self.record = recording(CHUNK, loop.model.nsensordata, loop.width)
        self.rows, self.mode = [here[None, :]], [stand.now.mode.copy()]
        self.u = [first_command(self.taps, stand.history, stand.now)[None, :]]
        self.events: list[Array] = [np.empty((0, loop.width))]
        self.rough: list[float] = []
        points = POINTS_ADAPTIVE if schedule.tolerance > 0 else POINTS
        self.tracker = ExtremesTracker(data.time, y, self._cuts, points)
        self.since: list[tuple[Array, Array]] = []  # outputs since the last event
        self.last = self.rows[0], self.u[0], self.mode[0]  # the row at the last stretch's end
        self.kept = True
        self.steps = 0

    def stretch(self, stepper: FixedLoop) -> tuple[Status, bool]:
        """One stretch; returns how the run continues, and whether the mode has changed."""
        stand, schedule, taps = self.stand, self.schedule, self.taps
        plan, note, go = entries()
        t, level, edges = stand.t, stand.level, schedule.edges
        while stand.edge < len(edges) and edges[stand.edge] <= t + SAME:
            level = min(level, int(self.levels[stand.edge]))
            stand.edge += 1
        longest = min(schedule.t_end, edges[stand.edge] if stand.edge < len(edges) else np.inf)
        level, end, guard = called(plan, taps, stand.history, stand.now, t, longest, level)
        length, status = (end - t) / taps.unit, Status.COMPLETED
        if end > t:
            if level < ROUGH:
                self.rough.append(t)
            self._command(t)
            times, y, status = self._fly(stepper, end)
            if status == Status.COMPLETED:
                values = self._at_nodes(times, y)
                if not called(note, taps, stand.history, t, level, values, length):
                    stand.history = widened(stand.history)
                level = SMOOTH
        switched = status == Status.COMPLETED and called(go, taps, stand.now, length, guard)
        with unhurried():
            ended = status != Status.COMPLETED or end >= schedule.t_end
            self._conclude(switched, ended)
            stand.t, stand.level = end, min(level, 0) if switched else level
        return (status if ended else Status.RUNNING), switched

    def _command(self, t: float) -> None:
        block, ports = self.loop.block, self.loop.plant.linearisation.ports
        block.header[Slot.SINCE], block.header[Slot.UNIT] = t, self.taps.unit
        block.course[ports.actuators] = ports.b[:, None] * self.stand.now.u

    def _fly(self, stepper: FixedLoop, end: float) -> tuple[Array, Array, Status]:
        """Step to the stretch's end: times and outputs on the way, from its begin on, and why the loop came back."""
        record, t, data = self.record, self.stand.t, self.data
        steps = _LEAST if end - t > _SHORT else 1
        # a row where the stretch begins is of the state there, under its command
        due = self.stand.row + (self.stand.row * self.schedule.record_interval <= t + SAME)
        stepper.resume(end, min(self.schedule.timestep, (end - t) / steps), due * self.schedule.record_interval)
        states = [np.concatenate([[t], data.qpos, data.qvel, data.act, data.sensordata])[None, :]]
        times, y, status = [np.array([t])], [self.loop.y(data.sensordata)[None, :]], Status.RUNNING
        while status == Status.RUNNING:
            record.clear()
            status = stepper.advance(record, CHUNK)
            with unhurried():
                n_dense, n_rows, _, taken = (int(n) for n in record.count)
                self.steps += taken
                dense = record.dense[:n_dense].copy()
                states.append(record.rows[:n_rows].copy())
                times.append(dense[:, 0])
                y.append(self.loop.y(dense[:, 1:]))
        with unhurried():
            self.since.append((np.concatenate(times[1:]), np.concatenate(y[1:])))
            self._record(np.concatenate(states))
        return np.concatenate(times), np.concatenate(y), status

    def _record(self, states: Array) -> None:
        """Keep rows at the multiples of the interval, from the stretch's begin on, of the engine's ``states`` on it."""
        stand, interval = self.stand, self.schedule.record_interval
        last = int(np.ceil((states[-1, 0] - SAME) / interval))
        t = interval * np.arange(stand.row, last, dtype=float)
        if len(t):
            stand.row = last
            self._keep(*self._commanded(self._states_at(t, states)))
        self.last, self.kept = self._commanded(states[-1:]), False

    def _states_at(self, t: Array, states: Array) -> Array:
        """Rows at these times: states of the engine that there are, else by a spline through those at its steps."""
        states = states[np.isfinite(states).all(axis=1)]  # of one that diverges, what there was before
        at = states[:, 0]
        near = np.abs(at - t[:, None]).argmin(axis=1)
        rows = states[near]
        between = np.abs(at[near] - t) > 1e-9 * (at[-1] - at[0])
        if between.any() and len(at) > 1:
            rows[between] = self._spline(at, states)(t[between] - at[0])
            for row in rows[between] if self.loop.model.nq != self.loop.model.nv else ():
                mujoco.mj_normalizeQuat(self.loop.model, row[1 : 1 + self.loop.model.nq])
        rows[:, 0] = t
        return rows

    def _at_nodes(self, times: Array, y: Array) -> Array:
        """The readings of these outputs at the nodes of the stretch, shape (nodes, n_y)."""
        nodes = (times[-1] - times[0]) / 2 * (1 + self.taps.nodes)
        spline = self._spline(times, y)
        u = np.polynomial.polynomial.polyval(nodes / self.taps.unit, self.stand.now.u.T).T
        read = spline(nodes) + self.loop.errors(times[0] + nodes), u[:, : self.stand.now.values.shape[1] - y.shape[1]]
        return np.ascontiguousarray(np.hstack(read))

    def _spline(self, times: Array, values: Array) -> Callable[[Array], Array]:
        """A spline through samples on the stretch, of the time since its begin."""
        from scipy.interpolate import make_interp_spline

        # samples much closer together than the others would magnify rounding
        gap = 0.05 * (times[-1] - times[0]) / (len(times) - 1)
        ahead, behind = times[1:-1] - times[:-2], times[-1] - times[1:-1]
        inside = np.flatnonzero((ahead > gap) & (behind > gap) & (times[-1] - times[0] > _SHORT)) + 1
        kept = np.concatenate([[0], inside, [len(times) - 1]])
        degree = min(_DEGREE, len(kept) - 1)
        return make_interp_spline(times[kept] - times[0], values[kept], degree, check_finite=False)

    def _commanded(self, rows: Array) -> tuple[Array, Array, np.ndarray]:
        """Rows of the stretch under way, with their commands and modes."""
        theta, now = (rows[:, 0] - self.stand.t) / self.taps.unit, self.stand.now
        u = np.asarray(np.polynomial.polynomial.polyval(theta, now.u.T).T, dtype=float)
        return rows, u, np.repeat(now.mode, len(rows))

    def _keep(self, rows: Array, u: Array, mode: np.ndarray) -> None:
        self.rows.append(rows)
        self.u.append(u)
        self.mode.append(mode)

    def _conclude(self, switched: bool, ended: bool) -> None:
        """At a switch and at the run's end there is a row, too, of what was before."""
        stand, t = self.stand, float(self.last[0][0, 0])
        if (switched or ended) and not self.kept:
            self._keep(*self.last)
            self.kept = True
            stand.row += int(stand.row * self.schedule.record_interval <= t + SAME)
        # what switches again at the same instant is one event
        if switched and self.since:
            self.events.append(self.last[0])
            times, y = (np.concatenate(parts) for parts in zip(*self.since, strict=True))
            self.tracker.add(times, y, np.array([len(times) - 1]))
            self.since.clear()
            self.rough.append(t)

    def _cuts(self, start: float, end: float) -> Array:
        """Times strictly between two others at which something is not smooth."""
        rough = np.unique(self.rough)
        return rough[(rough > start) & (rough < end)]
