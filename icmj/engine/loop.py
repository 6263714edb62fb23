"""Simulation of a controller on the physics engine."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from icmj.controller import ClockTrigger, Continuous, Controller, EventTrigger
from icmj.disturbance import disturbance_of
from icmj.engine.accuracy import estimate, order_of
from icmj.engine.closed_loop import close_loop
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import EVENT_TOLERANCE
from icmj.errors import SimulationError
from icmj.linear_plant import Array
from icmj.runfile import SimulationSettings
from icmj.simulation import Events, Simulation


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
    error_estimate: bool = True,
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
        error_estimate: measure the error by repeating the last interval at half the timestep.

    Returns:
        The run. ``u`` is the command −k̂x_h; a disturbance acts on the plant beside it. ``precision`` has
        ``integrator``, ``order``, ``timestep`` [s], ``event_tolerance`` [s], ``interval_error`` [s] and
        ``output_error`` (relative; both estimated over one interval), ``steps``, ``seconds``, ``implementation``.

    Raises:
        ModelError: if plant and design do not fit.
        SimulationError: if a named state or input does not exist, a start state has the wrong shape, or the timestep
            is not usable.
    """
    linear, assumed = plant.linearisation.plant, controller.design.plant
    x = _start(x0, settings.initial, linear.states, "plant")
    x_o = _start(x_o0, settings.observer, assumed.states, "observer")
    x_h = x_o if x_h0 is None else _start(x_h0, {}, assumed.states, "hold")
    disturbance = disturbance_of(settings.disturbance, linear.inputs)
    loop = close_loop(plant, controller, disturbance, settings.integrator, native)
    model = loop.model
    timestep = float(settings.timestep or model.opt.timestep)
    if not 1e-9 <= timestep <= settings.duration:
        raise SimulationError(f"timestep {timestep} s: expected between 1e-9 s and the duration, {settings.duration} s")
    schedule = loop.schedule(settings, timestep)

    begin = time.perf_counter()
    rows = loop.run(loop.start(x, x_o, x_h), schedule, progress)
    seconds = time.perf_counter() - begin
    precision: dict[str, float | int | str] = {
        "integrator": mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_"),
        "order": order_of(model),
        "timestep": timestep,
        "event_tolerance": EVENT_TOLERANCE,
        "steps": rows.steps,
        "seconds": seconds,
        "implementation": "native" if native else "python",
    }
    if error_estimate:
        accuracy = estimate(loop, schedule, rows)
        precision |= {"interval_error": accuracy.interval, "output_error": accuracy.output}

    trigger, samples, events = controller.trigger, loop.departures(rows.samples), loop.departures(rows.events)
    E = np.full(len(rows.samples), np.nan)
    if isinstance(trigger, EventTrigger):
        e = samples.x_h - samples.x_o
        E = np.einsum("ij,jk,ik->i", e, trigger.Q_t, e) - trigger.q_t**2
    return Simulation(
        plant="mujoco",
        control=_control(controller),
        t=rows.samples[:, 0],
        x=samples.x,
        y=samples.y,
        u=-samples.x_h @ controller.design.k.T,
        x_o=samples.x_o,
        x_h=samples.x_h,
        E=E,
        events=Events(rows.events[:, 0], events.x, events.x_o, events.x_h, rows.y_max, rows.y_min),
        outcome=rows.outcome,
        precision=precision,
        qpos=rows.samples[:, 1 : 1 + model.nq],
    )


def _control(controller: Controller) -> Literal["event", "clock", "continuous"]:
    match controller.trigger:
        case EventTrigger():
            return "event"
        case ClockTrigger():
            return "clock"
        case Continuous():
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
