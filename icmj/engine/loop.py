"""The closed loop on the physics engine, from event to event."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from icmj.controller import ClockTrigger, Continuous, Controller, EventTrigger
from icmj.disturbance import Disturbance, disturbance_of
from icmj.engine import reference
from icmj.engine.callbacks import installed
from icmj.engine.composition import block_of, compose
from icmj.engine.extremes import ExtremesTracker
from icmj.engine.plant import MujocoPlant
from icmj.engine.recording import Recording, Status, recording
from icmj.engine.schedule import EVENT_TOLERANCE, Schedule, phases_of
from icmj.errors import SimulationError
from icmj.linear_plant import Array
from icmj.runfile import SimulationSettings
from icmj.simulation import Events, Outcome, Simulation
from icmj.theory.error_system import error_system

CHUNK = 2000  # steps between two looks at the clock, the progress bar and the keyboard
ORDERS = {"RK4": 4}  # every other integrator of the engine is of first order in the activations


class Loop(Protocol):
    """Steps a composed model; see :class:`icmj.engine.reference.ReferenceLoop`."""

    def advance(self, record: Recording, steps: int) -> Status:
        """Take up to ``steps`` steps, writing into ``record``."""


def simulate(
    plant: MujocoPlant,
    controller: Controller,
    settings: SimulationSettings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    native: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate ``plant`` on the engine under ``controller``.

    Args:
        plant: the actual plant.
        controller: design, hold and trigger.
        settings: duration, start, step and disturbance. A timestep or integrator of ``None`` is the model's.
        x0: plant state at t = 0 as departure from the operating point, shape (n,); replaces ``settings.initial``.
        x_o0: observer state at t = 0, shape (n̂,); replaces ``settings.observer``.
        x_h0: hold state at t = 0, shape (n̂,); x_o0 if ``None``, since t = 0 is a sample.
        native: use the compiled callbacks and loop; otherwise the plain-Python oracle.
        progress: called now and then with the fraction done, 0–1.

    Returns:
        The run. ``u`` is the command −k̂x_h; a disturbance acts on the plant beside it.

    Raises:
        ModelError: if plant and design do not fit.
        SimulationError: if a named state or input does not exist, a start state has the wrong shape, or the timestep
            is not usable.
    """
    linear = plant.linearisation.plant
    disturbance = disturbance_of(settings.disturbance, linear.inputs)
    model = compose(plant, controller, disturbance)
    if settings.integrator is not None:
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{settings.integrator.upper()}")
    timestep = float(settings.timestep or model.opt.timestep)
    if not 1e-9 <= timestep <= settings.duration:
        raise SimulationError(f"timestep {timestep} s: expected between 1e-9 s and the duration, {settings.duration} s")
    data = mujoco.MjData(model)
    x = _start(x0, settings.initial, linear.states, "plant")
    x_o = _start(x_o0, settings.observer, controller.design.plant.states, "observer")
    x_h = x_o if x_h0 is None else _start(x_h0, {}, controller.design.plant.states, "hold")
    _set_state(plant, model, data, x, x_o, x_h)
    schedule = make_schedule(plant, controller, settings, timestep, disturbance)

    begin = time.perf_counter()
    run = _run(plant, model, data, schedule, native, progress)
    seconds = time.perf_counter() - begin
    trigger = controller.trigger
    parts = _split(plant, controller, run.samples)
    at_events = _split(plant, controller, run.events)
    E = np.full(len(run.samples), np.nan)
    if isinstance(trigger, EventTrigger):
        e = parts["x_h"] - parts["x_o"]
        E = np.einsum("ij,jk,ik->i", e, trigger.Q_t, e) - trigger.q_t**2
    feedback = parts["x_o" if isinstance(trigger, Continuous) else "x_h"]
    integrator = mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_")
    precision: dict[str, float | int | str] = {
        "integrator": integrator,
        "order": ORDERS.get(integrator, 1),
        "timestep": timestep,
        "event_tolerance": EVENT_TOLERANCE,
        "steps": run.steps,
        "seconds": seconds,
        "implementation": "native" if native else "python",
    }
    return Simulation(
        plant="mujoco",
        control=_control(controller),
        t=run.samples[:, 0],
        x=parts["x"],
        y=parts["y"],
        u=-feedback @ controller.design.k.T,
        x_o=parts["x_o"],
        x_h=parts["x_h"],
        E=E,
        events=Events(run.events[:, 0], at_events["x"], at_events["x_o"], at_events["x_h"], run.y_max, run.y_min),
        outcome=run.outcome,
        precision=precision,
        qpos=run.samples[:, 1 : 1 + model.nq],
    )


def implementation(native: bool) -> tuple[Any, Any, Any]:
    """The loop's class and the callbacks that go with it."""
    if native:
        from icmj.engine.native import NativeLoop, callbacks

        return NativeLoop, *callbacks()
    return reference.ReferenceLoop, reference.control, reference.act_dyn


def make_schedule(
    plant: MujocoPlant,
    controller: Controller,
    settings: SimulationSettings,
    timestep: float,
    disturbance: Disturbance,
) -> Schedule:
    """The times of a run with these settings."""
    trigger = controller.trigger
    rates = np.abs(np.linalg.eigvals(error_system(plant.linearisation.plant, controller.design, controller.hold).A_C))
    edges = disturbance.edges
    return Schedule(
        timestep=timestep,
        t_end=settings.duration,
        delta_min=trigger.delta_min if isinstance(trigger, EventTrigger) else 0.0,
        clock=trigger.interval if isinstance(trigger, ClockTrigger) else np.inf,
        edges=edges,
        phases=phases_of(edges),
        record_interval=settings.record_interval,
        limit=settings.limit,
        rate=float(rates.max()),
    )


@dataclass(frozen=True, eq=False)
class _Run:
    samples: Array
    events: Array
    y_max: Array
    y_min: Array
    steps: int
    outcome: Outcome


def _run(
    plant: MujocoPlant,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    schedule: Schedule,
    native: bool,
    progress: Callable[[float], None] | None,
) -> _Run:
    make, control, act_dyn = implementation(native)
    y_0 = plant.linearisation.y
    width = 1 + model.nq + model.nv + model.na + model.nsensordata
    record = recording(CHUNK, model.nsensordata, width)
    status, steps, interrupted = Status.RUNNING, 0, False
    with installed(control, act_dyn):
        loop: Loop = make(model, data, schedule, plant.linearisation.point.qpos)
        first = np.concatenate([[data.time], data.qpos, data.qvel, data.act, data.sensordata])
        samples, events = [first[None, :]], [np.empty((0, width))]
        tracker = ExtremesTracker(data.time, data.sensordata - y_0)
        while status == Status.RUNNING and not interrupted:
            record.clear()
            try:
                status = loop.advance(record, CHUNK)
                if progress is not None:
                    progress(min(data.time / schedule.t_end, 1.0))
            except KeyboardInterrupt:
                interrupted = True
            n_dense, n_samples, n_events = record.count
            steps += int(n_dense)
            samples.append(record.samples[:n_samples].copy())
            events.append(record.events[:n_events].copy())
            tracker.add(record.dense[:n_dense, 0], record.dense[:n_dense, 1:] - y_0, record.event_at[:n_events])
    y_max, y_min = tracker.result()
    at = np.concatenate(events)
    return _Run(
        np.concatenate(samples), at, y_max, y_min, steps, _outcome(status, data, schedule, at[:, 0], interrupted)
    )


def _outcome(status: Status, data: mujoco.MjData, schedule: Schedule, events: Array, interrupted: bool) -> Outcome:
    t = float(data.time)
    if interrupted:
        return Outcome("interrupted", t, f"interrupted at {t:.3f} s of {schedule.t_end:g} s")
    if status == Status.FELL:
        return Outcome("fell", t, f"a position departed further than {schedule.limit:g} at {t:.3f} s")
    if status == Status.DIVERGED:
        return Outcome("diverged", t, f"the state stopped being finite at {t:.3f} s")
    if status == Status.WARNED:
        names = [mujoco.mjtWarning(i).name for i, w in enumerate(data.warning) if w.number]
        return Outcome("diverged", t, f"the engine warned at {t:.3f} s: {', '.join(names)}")
    late = np.diff(events, prepend=0.0)[-20:]
    if len(late) == 20 and schedule.delta_min > 0 and (late <= schedule.delta_min * (1 + 1e-6)).all():
        return Outcome("sliding", t, f"the last intervals all collapsed to Δ_min = {schedule.delta_min:g} s")
    return Outcome("completed", t, f"ran to {t:g} s")


def _control(controller: Controller) -> Literal["event", "clock", "continuous"]:
    match controller.trigger:
        case EventTrigger():
            return "event"
        case ClockTrigger():
            return "clock"
    return "continuous"


def _start(values: ArrayLike | None, named: Mapping[str, float], names: tuple[str, ...], what: str) -> Array:
    if values is not None:
        x = np.array(values, dtype=float)
        if x.shape != (len(names),) or not np.isfinite(x).all():
            raise SimulationError(f"start state of the {what}: expected {len(names)} finite numbers, shape {x.shape}")
        return x
    x = np.zeros(len(names))
    for name, value in named.items():
        if name not in names:
            raise SimulationError(f"start state of the {what}: no state {name!r}; its states are {', '.join(names)}")
        x[names.index(name)] = value
    return x


def _set_state(
    plant: MujocoPlant, model: mujoco.MjModel, data: mujoco.MjData, x: Array, x_o: Array, x_h: Array
) -> None:
    point, nv = plant.linearisation.point, model.nv
    block = block_of(model)
    assert block is not None
    data.qpos[:] = point.qpos
    mujoco.mj_integratePos(model, data.qpos, x[:nv], 1.0)
    data.qvel[:] = point.qvel + x[nv : 2 * nv]
    data.act[: block.act.start] = point.act + x[2 * nv :]
    data.act[block.act] = np.concatenate([x_o, x_h])


def _split(plant: MujocoPlant, controller: Controller, rows: Array) -> dict[str, Array]:
    """Recorded rows (t, qpos, qvel, act, sensordata) as departures from the operating point."""
    point, n = plant.linearisation.point, controller.design.plant.n
    nq, nv, na = len(point.qpos), len(point.qvel), len(point.act)
    qpos, qvel, act, x_o, x_h, y = np.split(rows[:, 1:], np.cumsum([nq, nv, na, n, n]), axis=1)
    if nq == nv:
        position = qpos - point.qpos
    else:
        model = plant.spec.copy().compile()
        position = np.zeros((len(rows), nv))
        for departure, q in zip(position, qpos, strict=True):
            mujoco.mj_differentiatePos(model, departure, 1.0, point.qpos, q)
    x = np.hstack([position, qvel - point.qvel, act - point.act])
    return {"x": x, "x_o": x_o, "x_h": x_h, "y": y - plant.linearisation.y}
