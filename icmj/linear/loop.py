"""The exact simulation of the intermittently controlled linear plant: events root-found, nothing integrated by steps.

Between samples the state follows a matrix exponential. A step of the internal grid only fixes where its series is
expanded; on each step the event function is a polynomial (to round-off), and whether it reaches zero anywhere on the
step is decided by its Bernstein coefficients (:mod:`icmj.bernstein`), not by sampling. The same holds for the
limit on positions and for the extremes of the outputs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from icmj.controller import ClockTrigger, Continuous, Controller, EventTrigger
from icmj.disturbance import Disturbance, disturbance_of
from icmj.errors import SimulationError
from icmj.linear.closed_loop import ClosedLoop, closed_loop, stretches
from icmj.linear.history import History
from icmj.linear.watch import Watch
from icmj.linear_plant import Array, LinearPlant
from icmj.simulation import Outcome, Simulation

if TYPE_CHECKING:
    from icmj.runfile import SimulationSettings

SLIDING = 20  # successive intervals at Δ_min at the end of a run that are called sliding
_TINY = 1e-290  # a state below this is zero for every purpose; subnormal numbers would only be slow


def simulate(
    plant: LinearPlant,
    controller: Controller,
    settings: SimulationSettings,
    *,
    x0: Array | None = None,
    x_o0: Array | None = None,
    x_h0: Array | None = None,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate ``plant`` under ``controller`` from a departure from the operating point.

    Args:
        plant: the actual plant; its order may differ from that of the controller's model.
        controller: design, hold and trigger (event, clock or continuous).
        settings: duration, start, recording, limit and disturbances; ``timestep`` and ``integrator`` are for MuJoCo.
        x0, x_o0: start of plant (n,) and observer (n̂,), instead of the named states in ``settings``.
        x_h0: start of the hold state (n̂,); the observer's by default, which is a sample at t = 0.
        progress: called now and then with the fraction done, 0–1.

    Returns:
        Recorded at multiples of ``record_interval``, at every event (values just before the reset) and at the end.
        Events are exact to 1e-12 s. An event falls on the first time after Δ_min at which E ≥ 0, on Δ_min
        itself if E ≥ 0 there.

    Raises:
        SimulationError: if plant and controller do not fit, a start state is unknown, of the wrong shape or not
            finite, or a disturbance names an unknown input.
    """
    loop = closed_loop(plant, controller)
    x = _start(settings.initial, plant.states, x0, "initial")
    x_o = _start(settings.observer, controller.design.plant.states, x_o0, "observer")
    x_h = x_o if x_h0 is None else _start({}, controller.design.plant.states, x_h0, "hold")
    disturbance = disturbance_of(settings.disturbance, plant.inputs)
    history = History(loop, settings.record_interval, loop.state(x, x_o, x_h))
    try:
        outcome = _run(loop, settings, disturbance, history, progress)
    except KeyboardInterrupt:
        outcome = Outcome("interrupted", history.t, f"was interrupted at {history.t:.6g} s of {settings.duration:g} s")
    return history.simulation(outcome)


def position_states(plant: LinearPlant) -> Array:
    """Indices of the states that the limit guards: those with a ``<name>_rate`` beside them, else all."""
    positions = [i for i, name in enumerate(plant.states) if f"{name}_rate" in plant.states]
    return np.array(positions or range(plant.n))


def _run(
    loop: ClosedLoop,
    settings: SimulationSettings,
    disturbance: Disturbance,
    history: History,
    progress: Callable[[float], None] | None,
) -> Outcome:
    trigger, duration = loop.controller.trigger, float(settings.duration)
    positions = position_states(loop.plant)
    for stretch in stretches(loop, disturbance, duration):
        watch = Watch(loop, stretch.flow, positions, settings.limit)
        while history.t < stretch.end:
            t, z = history.t, history.z
            due, armed = _due(trigger, history)
            if np.abs(z).max() < _TINY:
                z = np.zeros_like(z)
            stop = min(due, stretch.end)
            piece = watch.advance(stretch.augmented(z, t), stop - t, armed)
            # landing on a time set in advance is exact; adding the piece's length would round
            end = stop if piece.complete and piece.kind == "end" else t + piece.length
            history.append(watch, piece, end)
            if piece.kind == "fell":
                return _fell(loop, positions, history, settings.limit)
            if piece.kind == "diverged":
                return Outcome("diverged", end, f"diverged at {end:.6g} s: a state exceeded 1e12")
            if piece.kind == "event" or (isinstance(trigger, ClockTrigger) and end == due):
                history.sample()
            if progress is not None:
                progress(end / duration)
    return _ended(trigger, history, duration)


def _due(trigger: EventTrigger | ClockTrigger | Continuous, history: History) -> tuple[float, bool]:
    """Time at which the trigger's state changes next, and whether E is watched until then."""
    if isinstance(trigger, ClockTrigger):
        return (history.samples + 1) * trigger.interval, False
    if isinstance(trigger, EventTrigger):
        ready = history.last_sample + trigger.delta_min
        return (np.inf, True) if history.t >= ready else (ready, False)
    return np.inf, False


def _fell(loop: ClosedLoop, positions: Array, history: History, limit: float) -> Outcome:
    state = positions[np.argmax(np.abs(history.z[positions]))]
    return Outcome(
        "fell",
        history.t,
        f"fell at {history.t:.6g} s: {loop.plant.states[state]} departed further than its limit of {limit:g}",
    )


def _ended(trigger: EventTrigger | ClockTrigger | Continuous, history: History, duration: float) -> Outcome:
    if isinstance(trigger, EventTrigger) and trigger.delta_min > 0:
        at_least = np.nonzero(history.intervals() > trigger.delta_min + 1e-12)[0]
        successive = history.samples - (at_least[-1] + 1 if len(at_least) else 0)
        if successive >= SLIDING:
            return Outcome(
                "sliding",
                duration,
                f"slid: the last {successive} intervals all collapsed to the least one, {trigger.delta_min:g} s: "
                "the event rule no longer decides when to sample",
            )
    return Outcome("completed", duration, f"ran to {duration:g} s")


def _start(named: Mapping[str, float], names: tuple[str, ...], given: Array | None, what: str) -> Array:
    if given is not None:
        state = np.array(given, dtype=float)
        if state.shape != (len(names),) or not np.isfinite(state).all():
            raise SimulationError(f"{what} state has shape {state.shape}; expected {len(names)} finite values")
        return state
    unknown = [name for name in named if name not in names]
    if unknown:
        raise SimulationError(f"{what} state {unknown[0]!r} does not exist; the states are {', '.join(names)}")
    return np.array([named.get(name, 0.0) for name in names], dtype=float)
