"""Coexisting attractors: the motions that the closed loop settles on from many starts, each reported separately."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from icmj.base.array import Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.case.result import Attractor
from icmj.controller.controller import Controller
from icmj.errors import SimulationError, expect
from icmj.linear.run import simulate as simulate_exactly
from icmj.measurement.measurement import Measurement, event_states, measure, reduced_states
from icmj.plant.linear_plant import LinearPlant, Match, match_ports, transformation
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation

MAGNITUDES = (0.3, 1.0, 3.0, 10.0)
_EXTENSIONS = 4


@limit_to_one_thread()
def attractors(
    plant: LinearPlant,
    controller: Controller,
    settings: Settings,
    *,
    starts: int = 40,
    seed: int = 0,
    magnitudes: tuple[float, ...] = MAGNITUDES,
    tolerance: float = 1e-4,
    progress: Callable[[int], None] | None = None,
    match: Match = "name",
) -> tuple[Attractor, ...]:
    """The motions that the linear closed loop reaches from ``starts`` random initial states, the most frequent first.

    Plant state and observer error are drawn at random; each entry is scaled by its largest value in the run that
    ``settings`` describes, and by the ``magnitudes`` in turn. A motion that has not settled is continued for up to
    eight times the duration. Two cycles are one attractor if their states at the events agree up to a shift along the
    cycle, or up to the sign (the loop is odd, so the mirror image of a motion is a motion); other motions are grouped
    by their kind. The limit on positions is not applied, because the loop is linear. The search may miss attractors
    with a small basin.

    Args:
        plant: the actual plant.
        controller: a controller with any trigger.
        settings: duration, disturbances, and the run that sets the scale.
        starts: number of initial states.
        seed: seed of the random initial states.
        magnitudes: factors on the scale, used in turn.
        tolerance: relative agreement of two cycles.
        progress: called with the number of starts done.
        match: how inputs and outputs of the plant are assigned to those of the controller's model, as for
            :func:`icmj.case.case.simulate_plant`.

    Raises:
        AnalysisError: if they do not correspond, or the controller is not intermittent.
        SimulationError: as :func:`icmj.linear.run.simulate`, or if the run that sets the scale stays at zero.
    """
    expect(controller, Controller, "the search for attractors", "simulate other controllers from starts of your own")
    plant = match_ports(plant, controller.design.plant, match)
    T_hat = transformation(controller.design.plant, plant)
    settings = replace(settings, limit=1e9, record_interval=settings.duration / 50)
    scale_x, scale_o = _scales(simulate_exactly(plant, controller, settings), T_hat)
    random = np.random.default_rng(seed)
    found: list[Attractor] = []
    for i in range(starts):
        magnitude = magnitudes[i % len(magnitudes)]
        x0 = magnitude * scale_x * random.standard_normal(plant.n)
        x_o0 = T_hat @ x0 + magnitude * scale_o * random.standard_normal(len(T_hat))
        measurement, states = _settle(plant, controller, settings, T_hat, x0, x_o0)
        new = Attractor(measurement, states, 1, 1 / starts, x0, x_o0)
        for j, known in enumerate(found):
            if _same(known, new, tolerance):
                count = known.count + 1
                found[j] = Attractor(known.measurement, known.states, count, count / starts, known.x0, known.x_o0)
                break
        else:
            found.append(new)
        if progress is not None:
            progress(i + 1)
    return tuple(sorted(found, key=lambda attractor: -attractor.count))


def _scales(run: Simulation, T_hat: Array) -> tuple[Array, Array]:
    scale = np.abs(reduced_states(run.x, run.x_o, T_hat)).max(axis=0)
    scale_x, scale_o = np.split(scale, [run.x.shape[1]])
    if not (scale_x.max() > 0 and np.isfinite(scale_x).all()):
        raise SimulationError("the run that sets the scale of the starts stays at zero; give it an initial state")
    return scale_x, scale_o


def _settle(
    plant: LinearPlant,
    controller: Controller,
    settings: Settings,
    T_hat: Array,
    x: Array,
    x_o: Array,
) -> tuple[Measurement, Array]:
    """The motion from (x, x_o), run again for twice as long while it has not settled."""
    for extension in range(_EXTENSIONS):
        longer = replace(settings, duration=settings.duration * 2**extension)
        run = simulate_exactly(plant, controller, longer, x0=x, x_o0=x_o)
        measurement = measure(run, T_hat=T_hat)
        # anything bounded that has not closed may still be a transient
        if measurement.kind in ("cycle", "homoclinic", "growth"):
            break
    states = event_states(run, T_hat)
    return measurement, states[len(states) - (measurement.p or 0) :]


def _same(known: Attractor, new: Attractor, tolerance: float) -> bool:
    if known.measurement.kind != new.measurement.kind or len(known.states) != len(new.states):
        return False
    if len(new.states) == 0:
        return True
    size = np.abs(known.states).max()
    return any(
        np.abs(known.states - sign * np.roll(new.states, shift, axis=0)).max() < tolerance * size
        for shift in range(len(new.states))
        for sign in (1, -1)
    )
