"""Simulation of a controller on the physics engine."""

from __future__ import annotations

import time
from collections.abc import Callable

import mujoco
from numpy.typing import ArrayLike

from icmj.base.environment import INTERPRETED, single_threaded
from icmj.controller.controller import Controller
from icmj.controller.law import Law
from icmj.engine.accuracy import estimate, order_of
from icmj.engine.closed_loop import close_loop
from icmj.engine.plant import MujocoPlant
from icmj.engine.saturation import applied, clipped, limited, shares
from icmj.engine.schedule import EVENT_TOLERANCE
from icmj.engine.stepping import stepping_of
from icmj.engine.tableau import METHODS
from icmj.errors import SimulationError
from icmj.simulation.disturbance import recorded
from icmj.simulation.labels import labels_of
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Events, Simulation
from icmj.simulation.start import start_states


@single_threaded()
def simulate(
    plant: MujocoPlant,
    controller: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
    error_estimate: bool = True,
) -> Simulation:
    """Simulate ``plant`` on the engine under ``controller``.

    Args:
        plant: the actual plant.
        controller: design, hold and trigger.
        settings: duration, start, steps and disturbance; see :func:`icmj.engine.stepping.stepping_of`.
        x0: plant state at t = 0 as departure from the operating point, shape (n,); replaces ``settings.initial``.
        x_o0: observer state at t = 0, shape (n̂,); replaces ``settings.observer``.
        x_h0: hold state at t = 0, shape (n̂,); x_o0 if ``None``, because t = 0 is an event.
        progress: called now and then with the fraction done, 0–1.
        error_estimate: measure the error by repeating the last interval at half the timestep, or a hundredth of the
            tolerance.

    Returns:
        The run. ``u`` is the command −k̂x_h; ``applied`` what acts of it and the disturbance beside it. ``precision``
        has ``integrator``, ``order``, ``timestep`` [s] (the mean, of adapted steps, with their ``tolerance``),
        ``event_tolerance`` [s], ``interval_error`` [s], ``output_error`` (relative; both estimated over one interval),
        ``output_errors`` (of each output), ``steps``, ``seconds``, ``implementation``; where
        there are limits ``saturated_share`` (of rows) and ``saturated`` (which inputs, how often); where sensors reach
        their cutoffs ``clipped_share`` and ``clipped`` (which outputs).

    Raises:
        ModelError: if plant and design do not fit.
        SimulationError: if a named state or input does not exist, a start state has the wrong shape, or the timestep
            is not usable.
    """
    if not isinstance(controller, Controller):
        raise SimulationError(f"a {controller.kind} controller is simulated on the linear plant only")
    x, a = start_states(plant.linearisation.plant, controller, settings, x0, x_o0, x_h0)
    loop = close_loop(plant, controller, settings)
    steps, model = stepping_of(loop, settings), loop.model
    schedule = loop.schedule(settings, steps.timestep, steps.tolerance)

    begin = time.perf_counter()
    record = loop.run(loop.data(x, a), schedule, progress)
    seconds = time.perf_counter() - begin
    precision: dict[str, float | int | str] = {
        "integrator": mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_"),
        "order": order_of(model),
        "timestep": steps.timestep,
        "event_tolerance": EVENT_TOLERANCE,
        "steps": record.steps,
        "seconds": seconds,
        "implementation": "interpreted" if INTERPRETED else "compiled",
    }
    if steps.tolerance:
        mean = float(record.rows[-1, 0]) / max(record.steps, 1)
        precision |= {"integrator": METHODS[schedule.method.order][0], "order": schedule.method.order}
        precision |= {"tolerance": steps.tolerance, "timestep": mean}
    if steps.refusal:
        precision["not_adaptive"] = steps.refusal
    if error_estimate:
        accuracy = estimate(loop, schedule, record)
        precision |= {"interval_error": accuracy.interval, "output_error": accuracy.output}
        precision |= {"error_stretch": accuracy.stretch, "fastest_rate": schedule.rate}
        outputs = plant.linearisation.plant.outputs
        precision["output_errors"] = ", ".join(
            f"{name} {error:.2g}" for name, error in zip(outputs, accuracy.outputs, strict=True)
        )

    rows, events = loop.departures(record.rows), loop.departures(record.events)
    u = -rows.x_h @ controller.design.k.T
    acting, cut = applied(plant, loop.disturbance, record.rows, u)
    if limited(model):
        precision |= shares(plant.linearisation.plant.inputs, cut)
    if (short := clipped(plant, record.rows)).any():
        precision |= shares(plant.linearisation.plant.outputs, short, "clipped")
    return Simulation(
        plant="mujoco",
        control=controller.trigger.kind,
        t=record.rows[:, 0],
        x=rows.x,
        y=rows.y,
        u=u,
        x_o=rows.x_o,
        x_h=rows.x_h,
        E=controller.trigger.faces(controller.design).E(rows.x_h - rows.x_o),
        events=Events(record.events[:, 0], events.x, events.x_o, events.x_h, record.y_max, record.y_min),
        outcome=record.outcome,
        precision=precision,
        qpos=record.rows[:, 1 : 1 + model.nq],
        delay=controller.delay.t_d,
        applied=acting,
        **recorded(loop.pushes, record.rows[:, 0]),
        least=controller.least,
        noisy=settings.noisy,
        labels=labels_of(plant.linearisation.plant, controller.design.plant),
    )
