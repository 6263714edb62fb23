"""The closed loop on the engine: plant and any controller in one composed model, which can be started."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.controller.law import Law
from icmj.engine.block import Block, find_block, read_numbers
from icmj.engine.buffers import States
from icmj.engine.composition import EmbeddedController, compose, embed, goes_by_steps, repack
from icmj.engine.isolation import isolate_engine
from icmj.engine.model import depart, make_data, name_states
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import Schedule, choose_phases, find_fastest_rate
from icmj.engine.stages import is_flow, may_constrain
from icmj.engine.units import name_state_units
from icmj.simulation import ending
from icmj.simulation.disturbance import Acting, Disturbance, Pushes, make_acting
from icmj.simulation.ending import Outcome
from icmj.simulation.grid import list_points
from icmj.simulation.native.loop import Status
from icmj.simulation.rows import list_edges
from icmj.simulation.settings import Settings
from icmj.simulation.taps import get_least_interval


@dataclass(frozen=True, eq=False)
class ComposedLoop:
    """Plant and controller in one model. A run changes ``model.opt.timestep``: use one for each thread.

    Attributes:
        plant, controller: what it was composed of.
        disturbance: beside the plant's commands.
        errors: of its outputs as the controller reads them; of one that goes by steps, and its own signals.
        pushes: on the plant itself.
        model: the composed model.
        numbers: the controller's own, where the model is another loop's and holds that one's between runs.
    """

    plant: MujocoPlant
    controller: Law
    disturbance: Disturbance
    errors: Disturbance
    pushes: Pushes
    model: mujoco.MjModel
    numbers: Array | None = None

    @cached_property
    def block(self) -> Block:
        """The controller in the form that the model contains."""
        block = find_block(self.model)
        assert block is not None
        return block

    def again(self, plant: MujocoPlant, controller: Controller, settings: Settings) -> ComposedLoop | None:
        """Like :func:`close_loop`, but sharing its model, which it writes to in its runs; only for the same thread.

        Returns:
            the loop, or ``None`` where its model has to be another.

        Raises:
            ModelError, SimulationError: as there.
        """
        if plant.spec is not self.plant.spec:
            return None
        acting = make_acting(plant.linearisation.plant, settings, controller)
        numbers = repack(self.model, plant, controller, acting, settings.duration)
        if numbers is None:
            return None
        loop = ComposedLoop(plant, controller, *acting, self.model, numbers)
        return loop if choose_integrator(loop, settings) == self.model.opt.integrator else None

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

    @cached_property
    def embedding(self) -> EmbeddedController:
        """What of the controller the model has."""
        return embed(self.controller)

    @property
    def own(self) -> int:
        """Number of the controller's states that the engine integrates."""
        return self.embedding.own

    @cached_property
    def by_steps(self) -> bool:
        """Whether it is followed step by step, not stretch by stretch."""
        return goes_by_steps(self.controller)

    @cached_property
    def fastest_rate(self) -> float:
        """Largest |λ| of plant and controller between events [rad/s]."""
        return find_fastest_rate(self.plant.linearisation.plant, self.controller)

    @property
    def noise(self) -> float:
        """The fastest sinusoid that acts on it [rad/s]."""
        return float(max(of.max(initial=0.0) for of in (self.acting.omega, self.controller.realisation.signals[:, 2])))

    def schedule(self, settings: Settings, timestep: float, tolerance: float = 0.0) -> Schedule:
        """The times of a run with these settings and this timestep, given, or chosen for a ``tolerance`` that is not 0.

        Raises:
            SimulationError: if a limit names what is no position.
        """
        # noise may be faster than the loop, and shakes E
        edges = list_points(self.acting.edges, self.acting.gaussian, settings.duration)
        return Schedule(
            timestep=timestep,
            tolerance=tolerance,
            t_end=settings.duration,
            edges=edges,
            phases=choose_phases(edges),
            record_interval=settings.record_interval,
            limits=self.plant.limits(settings.limit),
            rate=max(self.fastest_rate, self.noise),
            breaks=list_edges(self.acting, self.controller),
        )

    @property
    def n_y(self) -> int:
        """Number of outputs."""
        return len(self.plant.linearisation.ports.entries)

    @property
    def width(self) -> int:
        """Length of a row (t, qpos, qvel, act, sensordata)."""
        model = self.model
        return int(1 + model.nq + model.nv + model.na + model.nsensordata)

    def outcome(self, status: Status, t: float, data: mujoco.MjData, schedule: Schedule, events: Array) -> Outcome:
        """The outcome, from the loop's return code; ``RUNNING`` means that the run was interrupted."""
        if status == Status.RUNNING:
            return ending.end_interrupted(t, schedule.t_end)
        if status == Status.FELL:
            departure = np.zeros(self.model.nv)
            mujoco.mj_differentiatePos(self.model, departure, 1.0, self.plant.linearisation.point.qpos, data.qpos)
            at = int(np.argmax(np.abs(departure) / schedule.limits))
            return ending.end_fallen(
                t, name_states(self.model)[at], schedule.limits[at], name_state_units(self.model)[at]
            )
        if status == Status.DIVERGED:
            return ending.end_diverged(t, "the state stopped being finite")
        if status == Status.STALLED:
            return ending.end_stalled(t)
        if status == Status.WARNED:
            names = [mujoco.mjtWarning(i).name for i, w in enumerate(data.warning) if w.number]
            return ending.end_diverged(t, f"the engine warned ({', '.join(names)})")
        real = self.controller.realisation
        return ending.end_complete(t, np.diff(events, prepend=0.0), get_least_interval(real))

    @contextmanager
    def ready(self) -> Iterator[None]:
        """The callbacks installed and this controller in the model; on leaving all is put back that a run changes."""
        from icmj.engine.native.field import callbacks

        timestep, here = self.model.opt.timestep, read_numbers(self.model)
        held = here.copy()
        if self.numbers is not None:
            here[:] = self.numbers
        try:
            with isolate_engine(*callbacks()):
                yield
        finally:
            self.model.opt.timestep = timestep
            here[:] = held

    def state(self, rows: Array) -> Array:
        """The controller's state in recorded rows, shape (..., N_a)."""
        first = 1 + self.model.nq + self.model.nv + self.block.act.start
        return rows[..., first : first + len(self.block.M)]

    def departures(self, rows: Array) -> States:
        """Recorded rows as departures from the operating point; observer and hold of a controller with a trigger."""
        point = self.plant.linearisation.point
        nq, nv, na = len(point.qpos), len(point.qvel), len(point.act)
        layout = self.embedding.real.layout
        qpos, qvel, act, a, y = np.split(rows[:, 1:], np.cumsum([nq, nv, na, layout.size]), axis=1)
        position = np.zeros((len(rows), nv))
        if nq == nv:
            position = qpos - point.qpos
        else:
            for departure, q in zip(position, qpos, strict=True):
                mujoco.mj_differentiatePos(self.model, departure, 1.0, point.qpos, np.ascontiguousarray(q))
        x = np.hstack([position, qvel - point.qvel, act - point.act])
        observed = self.controller.observed
        x_o, x_h = (a[:, layout[name] if observed else slice(0, 0)] for name in ("x_o", "x_h"))
        return States(self.plant.linearisation.ports.reduce(x), x_o, x_h, self.y(y))

    def y(self, sensordata: Array) -> Array:
        """The readings of the controller, as deviations from the operating point, shape (..., n_y)."""
        ports = self.plant.linearisation.ports
        return ports.read(sensordata) + ports.beta - self.plant.linearisation.y


def close_loop(plant: MujocoPlant, controller: Law, settings: Settings) -> ComposedLoop:
    """Compose plant and controller, with the disturbance and integrator that ``settings`` name.

    Raises:
        ModelError: if plant and design do not fit; see :func:`icmj.engine.composition.compose`.
        SimulationError: if a disturbance names an unknown input, output or body.
    """
    acting = make_acting(plant.linearisation.plant, settings, controller if goes_by_steps(controller) else None)
    disturbance, errors, pushes = acting
    inside = None if controller.realisation.tapped else errors  # where the engine reads outputs, too
    model = compose(plant, controller, disturbance, inside, pushes, settings.duration)
    loop = ComposedLoop(plant, controller, *acting, model)
    loop.model.opt.integrator = choose_integrator(loop, settings)
    return loop


def choose_integrator(loop: ComposedLoop, settings: Settings) -> int:
    """The number of the integrator: that of the settings, that which a step is chosen for, or the model's own."""
    if settings.integrator is not None:
        return int(getattr(mujoco.mjtIntegrator, f"mjINT_{settings.integrator.upper()}"))
    if settings.timestep is None and not refuse_choice(loop, settings):
        return int(mujoco.mjtIntegrator.mjINT_RK4)
    return int(loop.plant.spec.option.integrator)


def refuse_choice(loop: ComposedLoop, settings: Settings) -> str:
    """Why no step can be chosen for a tolerance, because the motion may not be smooth; empty if one can.

    Without a tolerance in the settings, it cannot where anything *could* touch, rub or reach a limit; with one, where
    anything does at the operating point.
    """
    model = loop.model
    if not is_flow(model):
        return "an activation that is clamped or taken a step ahead, a body that sleeps or yields, or a flex"
    if not may_constrain(model):
        return ""
    if settings.tolerance is None:
        return "contacts, limits, friction losses or equalities may act"
    data = make_data(model, loop.plant.linearisation.point)
    with loop.ready():
        mujoco.mj_forward(model, data)
    return f"{data.nefc} constraints act at the operating point" if data.nefc else ""
