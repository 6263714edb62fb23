"""Simulation of a controller on the physics engine."""

from __future__ import annotations

import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.environment import single_threaded
from icmj.controller.controller import has_trigger
from icmj.controller.law import Law
from icmj.engine.accuracy import Accuracy, apart, estimate, facts, finer, scaled
from icmj.engine.closed_loop import ComposedLoop, close_loop
from icmj.engine.plant import MujocoPlant
from icmj.engine.saturation import applied, clipped, limited, shares
from icmj.engine.schedule import Schedule
from icmj.engine.stepping import stepping_of
from icmj.engine.tapped import TappedLoop, TappedRecord, close_tapped
from icmj.simulation.labels import labels_of
from icmj.simulation.recording import driven, kept
from icmj.simulation.settings import Settings, plant_start, start_states
from icmj.simulation.simulation import Events, Simulation
from icmj.simulation.taps import expect_no_observer, expect_readings, modes_of


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
        The run, recorded at multiples of ``record_interval`` (of fixed steps at the first end there or later), at every
        event (values just before the reset), at every action (values after it) and at the end. ``u`` is the command
        −k̂x_h; ``applied`` what acts of it and the disturbance beside it. ``precision``
        has ``integrator``, ``order``, ``timestep`` [s] (the mean, of adapted steps, with their ``tolerance``),
        ``event_tolerance`` [s], ``interval_error`` [s], ``output_error`` (relative; both estimated over one interval),
        ``output_errors`` (of each output), ``state_error`` (largest of a state), ``steps``, ``seconds``,
        ``implementation``; where
        there are limits ``saturated_share`` (of rows) and ``saturated`` (which inputs, how often); where sensors reach
        their cutoffs ``clipped_share`` and ``clipped`` (which outputs).

    Raises:
        ModelError: if plant and design do not fit.
        SimulationError: if a named state or input does not exist, a start state has the wrong shape, or the timestep
            is not usable.
    """
    if not has_trigger(controller):
        expect_no_observer(controller, settings, x_o0, x_h0)
        return simulate_tapped(plant, controller, settings, x0=x0, progress=progress, error_estimate=error_estimate)
    x, a = start_states(plant.linearisation.plant, controller, settings, x0, x_o0, x_h0)
    loop = close_loop(plant, controller, settings)
    steps = stepping_of(loop, settings)
    schedule = loop.schedule(settings, steps.timestep, steps.tolerance)

    begin = time.perf_counter()
    record = loop.run(loop.data(x, a), schedule, progress)
    seconds = time.perf_counter() - begin
    precision = facts(loop, steps, schedule, record, seconds)
    if error_estimate:
        precision |= estimate(loop, schedule, record).facts(schedule, plant.linearisation.plant.outputs)

    rows, events = loop.departures(record.rows), loop.departures(record.events)
    held, at_events = (kept(controller, of.x_o, of.x_h) for of in (rows, events))
    acting, reached = _limits(plant, loop, record.rows, held.u)
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
        precision=precision | reached,
        qpos=record.rows[:, 1 : 1 + loop.model.nq],
        delay=controller.delay.t_d,
        applied=acting,
        **driven(controller, loop.pushes, record.rows[:, 0]),
        least=controller.least,
        noisy=settings.noisy,
        labels=labels_of(plant.linearisation.plant, controller.design.plant),
    )


@single_threaded()
def simulate_tapped(
    plant: MujocoPlant,
    law: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
    error_estimate: bool = True,
) -> Simulation:
    """Simulate ``plant`` under any controller, from its realisation; outputs before t = 0 are those at the start.

    Args:
        plant, law, settings, x0, progress: as ``plant``, ``controller`` … of :func:`icmj.engine.run.simulate`.
        a0: start of the controller's state (N_a,), right after an event; zero if ``None``.
        error_estimate: as there, repeating the last seconds.

    Returns:
        The run, as of :func:`icmj.engine.run.simulate`. Events are those of the rule or the clock, or, of a controller
        without them, its switches. What the controller's state means is not known here: observer, hold and event
        function are not recorded.

    Raises:
        ModelError: if plant and controller do not fit.
        SimulationError: if a named state or input does not exist, the start state has the wrong shape, or the timestep
            is not usable.
    """
    linear = plant.linearisation.plant
    realisation = expect_readings(law, linear)
    x = plant_start(linear, settings, x0)
    loop = close_tapped(plant, law, settings)
    steps = stepping_of(loop, settings)
    schedule = loop.schedule(settings, steps.timestep, steps.tolerance)

    begin = time.perf_counter()
    a = np.zeros(len(loop.block.M))
    a[: realisation.layout.size * (not realisation.tapped)] = 0.0 if a0 is None else a0
    record = loop.run(loop.data(x, a), schedule, progress)
    precision = facts(loop, steps, schedule, record, time.perf_counter() - begin)
    if error_estimate:
        precision |= estimate_tapped(loop, schedule, record).facts(schedule, linear.outputs)

    rows, events = loop.departures(record.rows), loop.departures(record.events)
    acting, reached = _limits(plant, loop, record.rows, record.u)
    return Simulation(
        plant="mujoco",
        control=law.kind,
        t=record.rows[:, 0],
        x=rows.x,
        y=rows.y,
        u=record.u,
        x_o=rows.x_o,
        x_h=rows.x_h,
        E=np.full(len(record.rows), np.nan),
        events=Events(record.events[:, 0], events.x, events.x_o, events.x_h, record.y_max, record.y_min),
        outcome=record.outcome,
        precision=precision | reached,
        qpos=record.rows[:, 1 : 1 + loop.model.nq],
        applied=acting,
        noisy=settings.noisy,
        labels=labels_of(linear),
        **modes_of(realisation, record.mode),
        **driven(law, loop.pushes, record.rows[:, 0]),
    )


def estimate_tapped(loop: TappedLoop, schedule: Schedule, record: TappedRecord) -> Accuracy:
    """The error of the run's last seconds: of the outputs at their end, and of their last switch.

    What is read at their begin is that of the run; they are some delays long, so that what is read later is not.
    """
    end, runs = float(record.rows[-1, 0]), []
    for plan in (schedule, finer(schedule)):
        stand = deepcopy(record.stand)
        data = mujoco.MjData(loop.model)
        data.time = stand.t
        data.qpos[:], data.qvel[:], data.act[:] = stand.state
        runs.append(loop.run(data, replace(plan, t_end=end), stand=stand))
    coarse, fine = runs
    both_switched = 0 < len(coarse.events) == len(fine.events)
    interval = abs(float(coarse.events[-1, 0] - fine.events[-1, 0])) if both_switched else float("nan")
    found = apart(loop, coarse.rows, fine.rows, (coarse.rows[-1:], fine.rows[-1:]))
    return scaled(loop, schedule, interval, found, end - record.stand.t)


def _limits(
    plant: MujocoPlant, loop: ComposedLoop | TappedLoop, rows: Array, u: Array
) -> tuple[Array, dict[str, float | str]]:
    """What acts at recorded rows of the commands ``u``, and the limits of actuators and sensors that were reached."""
    acting, cut = applied(plant, loop.disturbance, rows, u)
    linear = plant.linearisation.plant
    reached = shares(linear.inputs, cut) if limited(loop.model) else {}
    if (short := clipped(plant, rows)).any():
        reached |= shares(linear.outputs, short, "clipped")
    return acting, reached
