"""Any controller on the engine, stretch by stretch, from its realisation alone.

Over a stretch (:mod:`icmj.simulation.native.taps`) what is read of earlier is known ahead. If that is all that the
controller reads, the engine integrates under its command, a polynomial in time, as it would under any other input; if
not, the controller's state is integrated with the plant (:mod:`icmj.engine.native.stretches`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.process import defer_interrupt as unhurried
from icmj.controller.controller import Law, has_trigger
from icmj.engine.closed_loop import (
    CHUNK,
    ComposedLoop,
    ExtremesTracker,
    Record,
    at_ports,
    close_loop,
    compose,
    integrator_of,
)
from icmj.engine.plant import MujocoPlant
from icmj.engine.safety import EngineFault, words
from icmj.engine.schedule import Recording, Schedule, fastest_rate, phases_of, recording
from icmj.simulation import ending
from icmj.simulation.disturbance import acting_on, edges_of
from icmj.simulation.native.loop import Status
from icmj.simulation.settings import Settings, points_between
from icmj.simulation.taps import (
    POWERS,
    History,
    Now,
    Taps,
    begin,
    copy_of,
    first_command,
    least_of,
    lengthen,
    levels_of,
    taps_of,
    waves_of,
    widen,
)

if TYPE_CHECKING:
    from icmj.engine.native.stretches import Reader, Track

_SWING = 3.0  # rad of a sinusoid that the polynomial of a stretch takes in: to 1e-11 of it
_SAMPLES = 4096  # of one stretch


class Tapped(NamedTuple):
    """What the march works on besides the engine: the controller, its history, where it is, and what is recorded."""

    taps: Taps
    history: History
    now: Now
    reader: Reader
    track: Track

    @property
    def own(self) -> int:
        """Number of states of the controller that are integrated with the plant."""
        return self.track.y.shape[1] - len(self.reader.entries)


@dataclass(frozen=True, eq=False)
class Stand:
    """The progress of a run between two stretches, from which it can be continued again.

    Attributes:
        t: now [s].
        history, now: of the controller.
        state: (qpos, qvel, act) of the engine.
    """

    t: float
    history: History
    now: Now
    state: tuple[Array, Array, Array]


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
    """Plant and any controller, in one model."""

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
        return Schedule(
            timestep=timestep, tolerance=tolerance, t_end=settings.duration, delta_min=0.0, clock=np.inf, delay=0.0,
            edges=edges, phases=phases_of(edges), record_interval=settings.record_interval,
            limits=self.plant.limits(settings.limit), rate=max(own, self.noise),
            breaks=edges_of(self.acting, self.controller),
        )  # fmt: skip

    def outcome(
        self, status: Status, t: float, data: mujoco.MjData, schedule: Schedule, events: Array
    ) -> ending.Outcome:
        """The outcome, from the loop's return code."""
        if status == Status.COMPLETED:
            real = self.controller.realisation
            return ending.ran(t, np.diff(events, prepend=0.0) if real.eventful else np.zeros(0), least_of(real))
        return super().outcome(status, t, data, schedule, events)

    def run(
        self,
        data: mujoco.MjData,
        schedule: Schedule,
        progress: Callable[[float], None] | None = None,
        stand: Stand | None = None,
    ) -> TappedRecord:
        """Run from ``data``, which are at the run's begin or at a ``stand``, until the schedule's end or another."""
        from icmj.engine.native.memory import run_guarded
        from icmj.engine.native.stretches import compile_stretches

        with self.ready():
            mujoco.mj_forward(self.model, data)
        tapped = self._make_tapped(data, schedule, stand)
        record = recording(CHUNK, self.model.nsensordata + tapped.own, self.width)
        log = _Log(self, tapped, data, schedule)
        status, steps, stopped, fault, crowded = int(Status.RUNNING), 0, False, "", None
        pace, every = ending.EventPace(schedule.t_end), max(1.0, 3 * self.controller.realisation.taps[-1])
        stands = [_stand(tapped, data)] * 2
        with self.ready():
            loop = self.stepper(data, schedule)
            try:
                while status == Status.RUNNING and crowded is None:
                    try:
                        arguments = (*loop.parts, record, *tapped, stands[-1].t + every)
                        status = int(run_guarded(compile_stretches(), arguments, loop.faulty))
                    except (EngineFault, mujoco.FatalError) as error:  # what was simulated before stays
                        fault = str(error) if isinstance(error, EngineFault) else words(error)
                        status = Status.DIVERGED
                    filled = max(int(record.count[:2].max()), int(tapped.track.counts[1]))
                    if filled > CHUNK // 8 or status != Status.RUNNING:
                        with unhurried():
                            steps += int(record.count[3])
                            crowded = pace.stalled(*log.take(record))
                    if status == Status.FULL:
                        tapped = tapped._replace(history=widen(tapped.history), now=lengthen(tapped.now))
                        status = int(Status.RUNNING)
                    if data.time >= stands[-1].t + every and not tapped.track.marks[1]:
                        stands = [stands[-1], _stand(tapped, data)]
                    if progress is not None:
                        progress(min(data.time / schedule.t_end, 1.0))
            except KeyboardInterrupt:
                stopped = True
                with unhurried():
                    steps += int(record.count[3])
                    log.take(record)
                if not steps:  # there is nothing to keep; it may have been compiling
                    raise
        rows, u, mode, events = (np.concatenate(part) for part in (log.rows, log.u, log.mode, log.events))
        t = float(data.time if status == Status.STALLED else rows[-1, 0])
        outcome = self.outcome(Status.RUNNING if stopped else Status(status), t, data, schedule, events[:, 0])
        if fault:
            outcome = ending.diverged(t, fault)
        elif crowded is not None and status == Status.RUNNING and not stopped:
            outcome = ending.stalled(t, crowded)
        y_max, y_min = log.tracker.result()
        return TappedRecord(rows, events, y_max, y_min, steps, outcome, u, mode, stands[0])

    def _make_tapped(self, data: mujoco.MjData, schedule: Schedule, stand: Stand | None) -> Tapped:
        """The controller and where it is, with its readings and records, for a run from ``data``."""
        from icmj.engine.native.stretches import Reader, Track

        realisation, here = self.controller.realisation, self.plant.linearisation
        # of a step that is a whole stretch the dense output is coarser than its end, from which its length follows
        own = max([fastest_rate(here.plant, self.controller), *(1 / tau for tau in realisation.delayed[:1])])
        n_y, n_u, n_a = self.controller.plant.n_y, self.controller.plant.n_u, realisation.layout.size
        taps = taps_of(realisation, n_y, max(own, self.noise / _SWING), exact=False)
        joint, ports, edges = not realisation.tapped, here.ports, schedule.edges
        if stand is None:
            a = data.act[self.block.act][:n_a] if joint else None
            history, now = begin(taps, realisation, self.y(data.sensordata) + self.errors(0.0), a)
            stand = Stand(0.0, history, now, ())  # type: ignore[arg-type]
        nu, entries = len(self.block.ctrl_0), len(self.block.y_0)
        modes = [at_ports(self.plant, mode, nu, entries) for mode in realisation.modes if joint]
        M, N, K, S = (
            np.array([getattr(mode, letter) for mode in modes], dtype=float).reshape(len(modes), *shape)
            for letter, shape in (("M", (n_a, n_a)), ("N", (n_a, entries)), ("K", (nu, n_a)), ("S", (nu, entries)))
        )
        reader = Reader(
            entries=ports.entries.astype(np.int64), gain=np.ascontiguousarray(ports.g),
            offset=np.ascontiguousarray(ports.beta - here.y),
            actuators=ports.actuators.astype(np.int64), b=np.ascontiguousarray(ports.b),
            levels=levels_of(edges, self.acting).astype(np.int64),
            errors=waves_of(schedule.t_end, (self.errors, np.eye(n_y))), joint=joint, M=M, N=N, K=K, S=S,
        )  # fmt: skip
        own_states = n_a if joint else 0
        track = Track(
            t=np.array([stand.t, stand.t, stand.t, 0.0]),
            marks=np.array([-1, 0, 0, 0, 0, 0]),
            counts=np.zeros(3, np.int64),
            at=np.zeros(_SAMPLES), y=np.zeros((_SAMPLES, n_y + own_states)),
            states=np.zeros((_SAMPLES, self.width)),
            near=np.zeros(_SAMPLES, np.int64), begin=np.zeros(self.model.nq + self.model.nv + self.model.na),
            curves=np.zeros((n_y + own_states, POWERS)), u=np.zeros((CHUNK, n_u)), mode=np.zeros(CHUNK, np.int64),
            rough=np.zeros(CHUNK),
        )  # fmt: skip
        return Tapped(taps, stand.history, stand.now, reader, track)


class _Log:
    """What a run has recorded, chunk by chunk."""

    def __init__(self, loop: TappedLoop, tapped: Tapped, data: mujoco.MjData, schedule: Schedule) -> None:
        here = np.concatenate([[data.time], data.qpos, data.qvel, data.act, data.sensordata])
        self._loop, self._track = loop, tapped.track
        self.rows, self.mode = [here[None, :]], [tapped.now.mode[:1].copy()]
        self.u = [first_command(tapped.taps, tapped.history, tapped.now)[None, :]]
        self.events: list[Array] = [np.empty((0, loop.width))]
        self._rough: list[Array] = []
        self.tracker = ExtremesTracker(data.time, loop.y(data.sensordata), self._cuts)

    def take(self, record: Recording) -> list[float]:
        """Take over what the last stretches recorded; of those there is nothing left to take. The times of events."""
        n_dense, n_rows, n_events, _ = (int(n) for n in record.count)
        track, events = self._track, record.events[:n_events].copy()
        dense = record.dense[:n_dense, : 1 + self._loop.model.nsensordata]
        self.rows.append(record.rows[:n_rows].copy())
        self.u.append(track.u[:n_rows].copy())
        self.mode.append(track.mode[:n_rows].copy())
        self.events.append(events)
        self._rough.append(track.rough[: track.counts[1]].copy())
        self.tracker.add(dense[:, 0], self._loop.y(dense[:, 1:]), record.event_at[:n_events])
        record.clear()
        track.counts[:2] = 0
        return [float(t) for t in events[:, 0]]

    def _cuts(self, start: float, end: float) -> Array:
        """Times strictly between two others at which something is not smooth; no later call is of an earlier start."""
        rough = np.unique(np.concatenate(self._rough))
        rough = rough[rough > start]
        self._rough = [rough]
        return rough[rough < end]


def _stand(tapped: Tapped, data: mujoco.MjData) -> Stand:
    """A copy of the present progress, with the engine's state."""
    history, now = copy_of(tapped.history, tapped.now)
    state = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    return Stand(float(data.time), history, now, state)


def close(plant: MujocoPlant, law: Law, settings: Settings) -> ComposedLoop:
    """Compose plant and controller, with a trigger or with delayed readings alone.

    Raises:
        ModelError, SimulationError: as for :func:`icmj.engine.closed_loop.close_loop`.
    """
    return close_loop(plant, law, settings) if has_trigger(law) else close_tapped(plant, law, settings)


def close_tapped(plant: MujocoPlant, law: Law, settings: Settings) -> TappedLoop:
    """Compose plant and controller; errors of delayed readings stay outside the model.

    Raises:
        ModelError, SimulationError: as for :func:`icmj.engine.closed_loop.close_loop`.
    """
    acting, errors, pushes = acting_on(plant.linearisation.plant, settings)
    inside = None if law.realisation.tapped else errors  # where the engine reads outputs, too
    model = compose(plant, law, acting, inside, pushes, settings.duration)
    loop = TappedLoop(plant, law, acting, errors, pushes, model)
    model.opt.integrator = integrator_of(loop, settings)
    return loop
