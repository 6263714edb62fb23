"""A run of a controller on the engine, from its start to its result."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.controller.controller import expect_intermittent
from icmj.controller.law import Law
from icmj.engine.accuracy import estimate, list_facts
from icmj.engine.buffers import States
from icmj.engine.closed_loop import ComposedLoop, close_loop
from icmj.engine.flow import Record, follow
from icmj.engine.limits import apply_limits, find_clipped, has_limit, measure_shares
from icmj.engine.plant import MujocoPlant
from icmj.engine.stepping import choose_stepping
from icmj.simulation.rows import (
    ControllerRows,
    collect_controls,
    collect_drives,
    keep_leads,
    keep_rows,
    lead_jumps,
    lead_rows,
)
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Events, Simulation
from icmj.simulation.start import start_states


@limit_to_one_thread()
def simulate(
    plant: MujocoPlant,
    controller: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
    error_estimate: bool = True,
) -> Simulation:
    """Simulate ``plant`` on the engine under ``controller``; outputs before t = 0 are those at the start.

    Args:
        plant: the actual plant.
        controller: design, hold and trigger, or any other, by its realisation (:mod:`icmj.engine.flow`).
        settings: duration, start, steps and disturbance; see :func:`icmj.engine.stepping.choose_stepping`.
        x0: plant state at t = 0 as departure from the operating point, shape (n,); replaces ``settings.initial``.
        x_o0: observer state at t = 0, shape (n̂,); replaces ``settings.observer``.
        x_h0: hold state at t = 0, shape (n̂,); x_o0 if ``None``, because t = 0 is an event.
        a0: start of the state of a controller without a trigger (N_a,), right after an event; zero if ``None``.
        progress: called repeatedly with the completed fraction, 0–1.
        error_estimate: measure the error by repeating the last interval, or the last seconds, at half the timestep.

    Returns:
        The run, recorded at multiples of ``record_interval`` (of a given timestep where a step ends next), at every
        event (values just before the reset), at every action and where what is given jumps (values after it), and at
        the end. Events are those of the trigger, or of the controller's rule or clock, or, of one without them, its
        switches. What the state of a controller without a trigger means is not known here: observer, hold and event
        function are not recorded. ``u`` is the command; ``applied`` what acts of it and the disturbance beside it.
        ``precision``
        has ``integrator``, ``order``, ``timestep`` [s] (and the ``tolerance`` that it is chosen for, if it is),
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
    linear = plant.linearisation.plant
    x, a = start_states(linear, controller, settings, x0, x_o0, x_h0, a0)
    loop = close_loop(plant, controller, settings)
    steps = choose_stepping(loop, settings)
    schedule = loop.schedule(settings, steps.timestep, steps.tolerance)

    begin = time.perf_counter()
    repeatable = error_estimate and not controller.observed
    inside = np.zeros(len(loop.block.M))
    inside[: loop.own] = a[: loop.own]
    record = follow(loop, loop.data(x, inside), schedule, progress, a=a, repeatable=repeatable)
    precision = list_facts(loop, steps, record, time.perf_counter() - begin)
    if error_estimate:
        precision |= estimate(loop, schedule, record).facts(schedule, linear.outputs)

    rows, events = loop.departures(record.rows), loop.departures(record.events)
    held, at_events = _hold_rows(controller, rows, record.u), _hold_rows(controller, events, record.u[:0])
    acting, reached = _limits(plant, loop, record.rows, held.u)
    drives = collect_drives(controller, loop.acting, record.rows[:, 0])
    leads, more = _leads(controller, record, rows, drives["edges"])
    return Simulation(
        plant="mujoco",
        t=record.rows[:, 0],
        x=rows.x,
        y=rows.y,
        events=Events(record.events[:, 0], events.x, at_events.x_o, at_events.x_h, record.y_max, record.y_min),
        outcome=record.outcome,
        precision=precision | reached,
        qpos=record.rows[:, 1 : 1 + loop.model.nq],
        applied=acting,
        jumps=record.jumps,
        leads=keep_leads(leads, lambda t, u: _limit_leads(plant, loop, record, t, u), loop.acting, more),
        **collect_controls(controller, linear, settings, held, record.mode),
        **drives,
    )


def _hold_rows(law: Law, states: States, u: Array) -> ControllerRows:
    """The controller at rows where its states are these, and its commands ``u``."""
    if law.observed:
        return keep_rows(expect_intermittent(law), states.x_o, states.x_h)
    return ControllerRows(states.x_o, states.x_h, u, law.faces.E(states.x))


def _leads(law: Law, record: Record, rows: States, edges: Array) -> tuple[Array, tuple[Array, ...]]:
    """(t, u) right before the rows of a run that contain what is after, and hold and event function, if there are."""
    t = record.rows[:, 0]
    if law.observed:
        return lead_rows(expect_intermittent(law), t, rows.x_o, rows.x_h, record.events[:, 0], edges)
    return lead_jumps(record.leads, record.jumps, t, record.u, edges), ()


def _limit_leads(plant: MujocoPlant, loop: ComposedLoop, record: Record, t: Array, u: Array) -> Array:
    """What acts at these times under commands ``u``, in the states of the first rows from there on."""
    rows = record.rows[np.searchsorted(record.rows[:, 0], t)].copy()
    rows[:, 0] = t
    return apply_limits(plant, loop.disturbance, rows, u)[0]


def _limits(plant: MujocoPlant, loop: ComposedLoop, rows: Array, u: Array) -> tuple[Array, dict[str, float | str]]:
    """What acts at recorded rows of the commands ``u``, and the limits of actuators and sensors that were reached."""
    acting, cut = apply_limits(plant, loop.disturbance, rows, u)
    linear = plant.linearisation.plant
    reached = measure_shares(linear.inputs, cut) if has_limit(loop.model) else {}
    if (short := find_clipped(plant, rows)).any():
        reached |= measure_shares(linear.outputs, short, "clipped")
    return acting, reached
