"""Simulation of a controller on the physics engine."""

from __future__ import annotations

import time
from collections.abc import Callable

from numpy.typing import ArrayLike

from icmj.base.environment import single_threaded
from icmj.controller.controller import Controller
from icmj.controller.law import Law
from icmj.engine.accuracy import estimate, facts
from icmj.engine.closed_loop import close_loop
from icmj.engine.plant import MujocoPlant
from icmj.engine.saturation import applied, clipped, limited, shares
from icmj.engine.stepping import stepping_of
from icmj.engine.tapped_run import simulate_tapped
from icmj.simulation.labels import labels_of
from icmj.simulation.recording import driven, kept
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Events, Simulation
from icmj.simulation.start import start_states
from icmj.simulation.taps import expect_no_observer


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
        controller: design, hold and trigger, or one that reads delayed outputs only (:mod:`icmj.engine.tapped`).
        settings: duration, start, steps and disturbance; see :func:`icmj.engine.stepping.stepping_of`.
        x0: plant state at t = 0 as departure from the operating point, shape (n,); replaces ``settings.initial``.
        x_o0: observer state at t = 0, shape (n̂,); replaces ``settings.observer``.
        x_h0: hold state at t = 0, shape (n̂,); x_o0 if ``None``, because t = 0 is an event.
        progress: called repeatedly with the completed fraction, 0–1.
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
        expect_no_observer(controller, settings, x_o0, x_h0)
        return simulate_tapped(plant, controller, settings, x0=x0, progress=progress, error_estimate=error_estimate)
    x, a = start_states(plant.linearisation.plant, controller, settings, x0, x_o0, x_h0)
    loop = close_loop(plant, controller, settings)
    steps, model = stepping_of(loop, settings), loop.model
    schedule = loop.schedule(settings, steps.timestep, steps.tolerance)

    begin = time.perf_counter()
    record = loop.run(loop.data(x, a), schedule, progress)
    seconds = time.perf_counter() - begin
    precision = facts(loop, steps, schedule, record, seconds)
    if error_estimate:
        precision |= estimate(loop, schedule, record).facts(schedule, plant.linearisation.plant.outputs)

    rows, events = loop.departures(record.rows), loop.departures(record.events)
    held, at_events = (kept(controller, of.x_o, of.x_h) for of in (rows, events))
    acting, cut = applied(plant, loop.disturbance, record.rows, held.u)
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
        u=held.u,
        x_o=held.x_o,
        x_h=held.x_h,
        E=held.E,
        events=Events(record.events[:, 0], events.x, at_events.x_o, at_events.x_h, record.y_max, record.y_min),
        outcome=record.outcome,
        precision=precision,
        qpos=record.rows[:, 1 : 1 + model.nq],
        delay=controller.delay.t_d,
        applied=acting,
        **driven(controller, loop.pushes, record.rows[:, 0]),
        least=controller.least,
        noisy=settings.noisy,
        labels=labels_of(plant.linearisation.plant, controller.design.plant),
    )
