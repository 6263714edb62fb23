"""The exact simulation of the intermittently controlled linear plant: events root-found, nothing integrated by steps.

Between events the state follows a matrix exponential. A step of the internal grid only fixes where its series is
expanded; on each step the event function is a polynomial (to round-off), and whether it reaches zero anywhere on the
step is decided by its Bernstein coefficients (:mod:`icmj.base.bernstein`), not by sampling. The same holds for the
limit on positions and for the extremes of the outputs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.controller.controller import Controller, layout_of
from icmj.linear.flight import Stage, stage
from icmj.linear.history import Collected, History
from icmj.linear.passage import Passage, suits
from icmj.linear.queue import Queue
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation import ending
from icmj.simulation.ending import Outcome
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation
from icmj.simulation.start import start_states


def simulate(
    plant: LinearPlant,
    controller: Controller,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate ``plant`` under ``controller`` from a departure from the operating point.

    Args:
        plant: the actual plant; its order may differ from that of the controller's model.
        controller: design, hold and trigger (event, clock or continuous).
        settings: duration, start, recording, limit and disturbances; ``timestep`` and ``integrator`` are for MuJoCo.
        x0, x_o0: start of plant (n,) and observer (n̂,), instead of the named states in ``settings``.
        x_h0: start of the hold state (n̂,); the observer's by default, because t = 0 is an event.
        progress: called now and then with the fraction done, 0–1.

    Returns:
        Recorded at multiples of ``record_interval``, at every event (values just before the reset) and at the end.
        Events are exact to 1e-12 s.

    Raises:
        SimulationError: if plant and controller do not fit, a start state is unknown, of the wrong shape or not
            finite, or a disturbance names an unknown input or output.
    """
    x, a = start_states(plant, controller, settings, x0, x_o0, x_h0)
    prepared = stage(plant, controller, settings)
    known = layout_of(controller).split(a)
    start = prepared.loop.state(x, known["x_o"], known["x_h"])
    if settings.native and suits(prepared):
        collected, outcome = Passage(prepared, settings.record_interval).run(start, progress)
    else:
        collected, outcome = _piece_by_piece(prepared, settings.record_interval, start, progress)
    run = collected.simulation(prepared.loop, outcome, settings.noisy)
    return replace(run, applied=run.u + prepared.disturbance(run.t)) if len(prepared.disturbance) else run


def _piece_by_piece(
    prepared: Stage, interval: float, start: Array, progress: Callable[[float], None] | None
) -> tuple[Collected, Outcome]:
    history = History(prepared.loop, interval, start)
    try:
        outcome = _run(prepared, history, progress)
    except KeyboardInterrupt:
        if history.t == 0:
            raise
        outcome = ending.interrupted(history.t, prepared.duration)
    return history.collected(), outcome


def _run(prepared: Stage, history: History, progress: Callable[[float], None] | None) -> Outcome:
    duration, queue = prepared.duration, Queue(prepared.loop.controller)
    pace = ending.EventPace(duration)
    while history.t < duration:
        if prepared.loop.controller.delay:
            queue.take_up(history.t, prepared.loop.x_o(history.z), prepared.loop.x_h(history.z))
        for watch, piece, t in prepared.flight(history.z, history.t, queue):
            history.append(watch, piece, t)
            if progress is not None:
                progress(t / duration)
        if piece.kind in ("fell", "diverged"):
            return prepared.outcome(piece.kind, piece.z, t)
        if piece.kind == "event":
            history.event()
            if (took := pace.stalled(t)) is not None:
                return ending.stalled(t, took)
    return ending.ran(duration, history.intervals(), prepared.loop.controller.least)
