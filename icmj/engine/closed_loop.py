"""The closed loop on the engine: composed as one model, started and simulated.

The closed loop as an ordinary MuJoCo model: the plant and an actuator whose activations are the controller's states.

The composed model is the plant's, with two elements more, both named ``icmj_controller``:

* an actuator without force (``gainprm="0"``, on the first joint) with ``dyntype="user"`` and as many activations as the
  controller has states, so that MuJoCo's integrator takes plant, observer and hold through the same stages,
  and save, restore, roll-out and finite differences see them;
* a ``<numeric>`` that holds the controller (:mod:`icmj.engine.block`), so that a callback needs nothing but the model
  it is called on.

Geoms that are only for the eye are left out, which a step is a seventh faster for: poses are drawn with the plant's own
model. They stay where they could matter, in a medium or under a rangefinder.

Disturbances act beside commands, pushes on the plant itself; the observer is driven by the command u, which is all that
a controller knows, and by the outputs with their errors, which the plant does not feel.

Extremes of the outputs between events, to better than the integrator's order.

A composed model (plant and controller) that can be started and simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.base.process import defer_interrupt
from icmj.base.roots import ONE_INSTANT
from icmj.controller.controller import Controller, Law, has_trigger
from icmj.controller.realisation import Layout, Mode, Realisation
from icmj.engine.block import Block, block_of, is_flow, may_constrain, numbers_of, pack
from icmj.engine.linearisation import places, spread
from icmj.engine.model import data_at, depart, model_name, state_names
from icmj.engine.operating_point import state_units
from icmj.engine.plant import MujocoPlant
from icmj.engine.safety import EngineFault, isolate_engine, words
from icmj.engine.schedule import Schedule, States, fastest_rate, phases_of, recording
from icmj.errors import ModelError
from icmj.simulation import ending
from icmj.simulation.disturbance import NO_PUSHES, Acting, Disturbance, Pushes, acting_on, edges_of, no_disturbance
from icmj.simulation.ending import Outcome
from icmj.simulation.native.loop import Status
from icmj.simulation.settings import Settings, points_between
from icmj.simulation.taps import POWERS

if TYPE_CHECKING:
    from icmj.engine.native.fixed_steps import FixedSteps

NAME = "icmj_controller"


def compose(
    plant: MujocoPlant,
    controller: Law,
    disturbance: Disturbance,
    errors: Disturbance | None = None,
    pushes: Pushes = NO_PUSHES,
    duration: float = 0.0,
) -> mujoco.MjModel:
    """The closed-loop model of ``plant`` under ``controller``; the plant's file and spec are not touched.

    Outputs and inputs are those of the plant's ports; the operating point of the actual plant is where controls and
    outputs are counted from. ``errors`` are those of the outputs as the observer reads them, ``pushes`` act on the
    plant itself; Gaussian noise is drawn for a run of ``duration`` [s].

    Raises:
        ModelError: if the numbers of inputs or outputs do not fit the design, or a sensor needs accelerations (it
            would close an algebraic loop through the controller).
        SimulationError: if the model has not what is pushed.
    """
    bare = plant.model
    _check(bare, model_name(bare), plant, controller)
    there = standing(controller)
    errors = no_disturbance(plant.linearisation.plant.n_y) if errors is None else errors
    data = _pack(bare, bare.nu, bare.na, plant, there, disturbance, errors, pushes, duration)
    size = there.real.layout.size
    model = plant.models.copy_with_room(
        plant.linearisation.point, size, len(data), lambda room: _compile(plant.spec.copy(), bare, size, room)
    )
    numbers_of(model)[: len(data)] = data
    return model


def _compile(spec: mujoco.MjSpec, bare: mujoco.MjModel, size: int, room: int) -> mujoco.MjModel:
    """The model of ``spec`` with an actuator of ``size`` states, and ``room`` numbers that are still zero."""
    ranging = np.any(bare.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER)
    spec.compiler.discardvisual = not (ranging or bare.opt.density or bare.opt.viscosity)
    # what contacts leave unsolved is an error of every step that falls neither with the step nor with the threshold
    spec.option.tolerance, spec.option.iterations = 0.0, max(200, spec.option.iterations)
    for key in spec.keys:
        # a keyframe that lists controls or activations must list those of the controller, too
        if len(key.ctrl):
            key.ctrl = [*key.ctrl, 0.0]
        if len(key.act):
            key.act = [*key.act, *np.zeros(size)]
    never = mujoco.mjtLimited.mjLIMITED_FALSE
    # every law and limit is named, for a model's own defaults would give it a servo's bias or a muscle's force
    spec.add_actuator(
        name=NAME, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=spec.joints[0].name or _name_states(spec.joints[0]),
        dyntype=mujoco.mjtDyn.mjDYN_USER, actdim=size, dynprm=np.zeros(10),
        gaintype=mujoco.mjtGain.mjGAIN_FIXED, gainprm=np.zeros(10),
        biastype=mujoco.mjtBias.mjBIAS_NONE, biasprm=np.zeros(10), damping=np.zeros(3), armature=0.0,
        ctrllimited=never, forcelimited=never, actlimited=never, inheritrange=0.0, nsample=0, delay=0.0,
    )  # fmt: skip
    spec.add_numeric(name=NAME, data=np.zeros(room), size=room)
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(
            f"model {model_name(bare)!r} cannot take the controller: {' '.join(str(error).split())}"
        ) from error


@dataclass(frozen=True, eq=False)
class Standing:
    """What of a controller stands in a model.

    Attributes:
        real: a realisation of one mode, with what the engine integrates as its state.
        powers: number of coefficients of what enters as a function of time alone.
        rated: whether that enters the rates of the state, too.
    """

    real: Realisation
    powers: int = 0
    rated: bool = False


def standing(controller: Law) -> Standing:
    """What of a controller stands in a model.

    What a controller that reads delayed outputs commands is known ahead: an idle state stands for it, and its command
    as polynomials in time. Any other moves with the plant in the mode that it is in, under what delayed readings and
    signals add to its rates and to its command; events, guards and modes are the affair of whoever runs it.
    """
    real = controller.realisation
    if has_trigger(controller):
        return Standing(real)
    n_u, n_y = controller.plant.n_u, controller.plant.n_y
    own = real.layout.size if not real.tapped else 0
    size = max(own, 1)
    M, N, K, S = np.zeros((size, size)), np.zeros((size, n_y)), np.zeros((n_u, size)), np.zeros((n_u, n_y))
    if not real.tapped:
        first = real.modes[0]
        M[:own, :own], N[:own], K[:, :own], S[:] = first.M, first.N[:, :n_y], first.K, first.S[:, :n_y]
    layout = Layout.of(x_o=0, x_h=0, own=size)
    mode = Mode("own", M, N, K, S)
    here = Realisation(layout, (mode,), np.eye(size), np.eye(size), np.zeros((0, size)), np.zeros(1, dtype=int))
    return Standing(here, POWERS, not real.tapped)


def repack(
    model: mujoco.MjModel,
    plant: MujocoPlant,
    controller: Law,
    disturbance: Disturbance,
    errors: Disturbance,
    pushes: Pushes,
    duration: float = 0.0,
) -> Array | None:
    """The numeric data that a composed ``model`` of the same spec would have for another controller or gain.

    Returns:
        the data; ``None`` where they would not lie alike, number for number and zero for zero.

    Raises:
        ModelError: as for :func:`compose`.
    """
    there, held = standing(controller), numbers_of(model)
    _check(model, model_name(model), plant, controller)
    na = int(model.na - model.actuator_actnum[-1])
    data = _pack(model, model.nu - 1, na, plant, there, disturbance, errors, pushes, duration)
    if len(data) > len(held):
        return None
    data = np.append(data, np.zeros(len(held) - len(data)))
    return data if np.array_equal(data != 0, held != 0) else None


def _pack(
    model: mujoco.MjModel,
    nu: int,
    na: int,
    plant: MujocoPlant,
    there: Standing,
    disturbance: Disturbance,
    errors: Disturbance,
    pushes: Pushes,
    duration: float,
) -> Array:
    """The controller at the ports of the plant: gains enter K, N, S and the disturbance only."""
    ports, point, controls = plant.linearisation.ports, plant.linearisation.point, there.real
    # signals of the controller's own stand behind all sensors
    signals = controls.N.shape[1] - len(ports.entries)
    entries = np.append(ports.entries, model.nsensordata + np.arange(signals))
    g = np.append(ports.g, np.ones(signals))
    mode, y_0 = at_ports(plant, controls.modes[0], nu, model.nsensordata, signals), np.zeros(model.nsensordata)
    # what the controller takes for the operating point: a bias makes it read more than there is
    y_0[ports.entries] = (plant.linearisation.y - ports.beta) / ports.g
    acting = replace(
        disturbance,
        n_u=nu,
        input=ports.actuators[disturbance.input],
        amplitude=ports.b[disturbance.input] * disturbance.amplitude,
    )
    # errors are of what is read, after the sensor's gain
    reading = replace(
        errors,
        n_u=mode.N.shape[1],
        input=entries[errors.input],
        amplitude=errors.amplitude / g[errors.input],
    )
    stage = max(int(model.sensor_needstage[i]) for i in _sensors(model, plant))
    pushes = spread(plant.model, point, pushes)
    where = places(model, pushes.places, plant.linearisation.plant.inputs, ports.actuators)
    scaled = replace(controls, modes=(mode,))
    drawn = (
        [(int(ports.actuators[i]), float(ports.b[i]), noise) for i, noise in disturbance.gaussian],
        [(int(entries[i]), 1 / float(g[i]), noise) for i, noise in errors.gaussian],
        [(i, 1.0, noise) for i, noise in pushes.size.gaussian],
        [(int(ports.actuators[i]), 1.0, noise) for i, noise in disturbance.shares],
    )
    return pack(
        scaled, y_0, point.ctrl, acting, reading, where, pushes.size, na, stage, there.powers, there.rated, drawn,
        duration,
    )  # fmt: skip


def at_ports(plant: MujocoPlant, mode: Mode, nu: int, entries: int, signals: int = 0) -> Mode:
    """A mode that reads ``entries`` sensor data and then ``signals``, and commands ``nu`` actuators.

    Its matrices are those of the controller's readings and commands, with the gains of the ports: of a mode that reads
    the current outputs first.
    """
    ports, n_y = plant.linearisation.ports, len(plant.linearisation.ports.entries)
    size, columns = len(mode.M), np.append(ports.entries, entries + np.arange(signals))
    g = np.append(ports.g, np.ones(signals))
    K, N, S = np.zeros((nu, size)), np.zeros((size, entries + signals)), np.zeros((nu, entries + signals))
    K[ports.actuators] = ports.b[:, None] * mode.K
    N[:, columns] = mode.N[:, : n_y + signals] * g
    S[np.ix_(ports.actuators, ports.entries)] = ports.b[:, None] * mode.S[:, :n_y] * ports.g
    return Mode(mode.name, mode.M, N, K, S)


def _sensors(bare: mujoco.MjModel, plant: MujocoPlant) -> list[int]:
    """The sensors that outputs are read from."""
    entries = plant.linearisation.ports.entries
    return sorted({int(np.searchsorted(bare.sensor_adr, entry, side="right")) - 1 for entry in entries})


def _check(bare: mujoco.MjModel, name: str, plant: MujocoPlant, controller: Law) -> None:
    mine, assumed = plant.linearisation.plant, controller.plant
    if (mine.n_u, mine.n_y) != (assumed.n_u, assumed.n_y):
        raise ModelError(
            f"model {name!r} has {mine.n_u} inputs and {mine.n_y} outputs, the controller's design "
            f"{assumed.n_u} and {assumed.n_y}; they must agree"
        )
    for i in _sensors(bare, plant):
        if bare.sensor_needstage[i] == mujoco.mjtStage.mjSTAGE_ACC:
            raise ModelError(
                f"model {name!r}: sensor {bare.sensor(i).name!r} needs accelerations, which depend on the control it "
                "would determine; use position or velocity sensors as outputs"
            )
    if bare.nplugin:
        raise ModelError(f"model {name!r} has engine plugins, whose state a step cannot be undone over")


def _name_states(joint: mujoco.MjsJoint) -> str:
    joint.name = f"{NAME}_joint"
    return str(joint.name)


POINTS = 6  # a quintic: its sixth-order error stays below that of the fourth-order integrator

Jumps = Callable[[float, float], Array]


class ExtremesTracker:
    """Largest and smallest output of each open-loop interval, from the outputs at every step.

    Chunks of steps are added as they come; only the steps of the interval under way are kept.
    """

    def __init__(self, t: float, y: Array, jumps: Jumps | None = None) -> None:
        """Start at ``t`` with outputs ``y`` (n_y,).

        ``jumps`` gives the times between two others at which accelerations may jump.
        """
        self._jumps = jumps or (lambda start, end: np.zeros(0))
        self._t = np.array([t])
        self._y = np.array([y])
        self._max: list[Array] = []
        self._min: list[Array] = []

    def add(self, t: Array, y: Array, event_at: np.ndarray) -> None:
        """Add steps at ``t`` (M,) with outputs ``y`` (M, n_y), of which those at ``event_at`` end an interval."""
        from icmj.engine.native.extremes import extremes

        at = np.asarray(event_at, dtype=int) + len(self._t)
        self._t = np.concatenate([self._t, t])
        self._y = np.concatenate([self._y, y])
        start = 0
        for end in at:
            t_i, y_i = self._t[start : end + 1], self._y[start : end + 1]
            inside = self._jumps(float(t_i[0]), float(t_i[-1]))
            # a jump at either end cuts nothing, whatever the last bit of its time is
            inside = inside[(inside - t_i[0] > ONE_INSTANT) & (t_i[-1] - inside > ONE_INSTANT)]
            cuts = np.concatenate([[0], np.searchsorted(t_i, inside - ONE_INSTANT), [len(t_i) - 1]])
            high, low = extremes(t_i, y_i, POINTS, cuts)
            self._max.append(high)
            self._min.append(low)
            start = end
        self._t, self._y = self._t[start:], self._y[start:]

    def result(self) -> tuple[Array, Array]:
        """(y_max, y_min) of the completed intervals, shapes (K, n_y)."""
        shape = (len(self._max), self._y.shape[1])
        return np.array(self._max).reshape(shape), np.array(self._min).reshape(shape)


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
        if plant.spec is not self.plant.spec:
            return None
        acting = acting_on(plant.linearisation.plant, settings, controller)
        numbers = repack(self.model, plant, controller, *acting, settings.duration)
        if numbers is None:
            return None
        loop = ComposedLoop(plant, controller, *acting, self.model, numbers)
        return loop if integrator_of(loop, settings) == self.model.opt.integrator else None

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
        """The times of a run with these settings and this timestep, given, or chosen for a ``tolerance`` that is not 0.

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
            sampling=self.controller.sampling_delay,
            breaks=edges_of(self.acting, self.controller),
        )

    def stepper(self, data: mujoco.MjData, schedule: Schedule) -> FixedSteps:
        """A stepper of the model from event to event, from the state in ``data``; within :meth:`ready`."""
        from icmj.engine.native.fixed_steps import FixedSteps

        return FixedSteps(self.model, data, schedule, self.plant.linearisation.point.qpos)

    def tracker(self, data: mujoco.MjData, schedule: Schedule) -> ExtremesTracker:
        """The object that finds the extremes of the outputs of a run from ``data``."""
        return ExtremesTracker(data.time, self.y(data.sensordata), schedule.jumps)

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
                with defer_interrupt():
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
        if status == Status.STALLED:
            return ending.stalled(t)
        if status == Status.WARNED:
            names = [mujoco.mjtWarning(i).name for i, w in enumerate(data.warning) if w.number]
            return ending.diverged(t, f"the engine warned ({', '.join(names)})")
        return ending.ran(t, np.diff(events, prepend=0.0), self.controller.least)

    @contextmanager
    def ready(self) -> Iterator[None]:
        """The callbacks installed and this controller in the model; on leaving all is put back that a run changes."""
        from icmj.engine.native.field import callbacks

        timestep, here = self.model.opt.timestep, numbers_of(self.model)
        held = here.copy()
        if self.numbers is not None:
            here[:] = self.numbers
        try:
            with isolate_engine(*callbacks()):
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
        ModelError: if plant and design do not fit; see :func:`icmj.engine.closed_loop.compose`.
        SimulationError: if a disturbance names an unknown input, output or body.
    """
    acting = acting_on(plant.linearisation.plant, settings, controller)
    loop = ComposedLoop(plant, controller, *acting, compose(plant, controller, *acting, settings.duration))
    loop.model.opt.integrator = integrator_of(loop, settings)
    return loop


def integrator_of(loop: ComposedLoop, settings: Settings) -> int:
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
    data = data_at(model, loop.plant.linearisation.point)
    with loop.ready():
        mujoco.mj_forward(model, data)
    return f"{data.nefc} constraints act at the operating point" if data.nefc else ""
