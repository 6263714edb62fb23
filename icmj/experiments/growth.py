"""Growth per interval under a clock: measured in simulation, for comparison with the prediction of panel (a)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from icmj.case.case import Case, PlantKind, expect_rule, expect_theory, open_loop
from icmj.case.result import Growth
from icmj.controller.trigger import ClockTrigger
from icmj.errors import SimulationError
from icmj.measurement.measurement import growth_per_interval, reduced_states
from icmj.theory.error_system import ErrorSystem

SIZE = 1e-6  # of the start state: small enough that the engine's plant is linear, far above rounding
LEAST_INTERVALS = 6  # the least that a growth is measured from


def undriven(case: Case) -> Case:
    """The same case without set-point and disturbances: the loop itself, of which eigenvalues and orbits are."""
    controller = replace(expect_rule(case, "a loop without set-point"), setpoint=None)
    settings = replace(case.settings, disturbance=())
    run = case.run.with_(**{"setpoint": None, "simulation.disturbance": None})
    return replace(case, run=run, controller=controller, settings=settings)


def measure_growth(case: Case, plant: PlantKind, points: int) -> Growth | None:
    """Simulate the case under clocks with intervals around Δ_crit, and measure the growth of x̄ from event to event.

    Each run starts along the dominant eigenvector of φ(Δ), so that the growth appears immediately. Like φ(Δ), it is of
    the loop itself: set-point and disturbances of the case are left out.

    Returns:
        The points; ``None`` if ``points`` is 0. If Δ_crit is undefined, they are spread over the interval searched.
        Values that overflow are NaN.
    """
    theory, case = expect_theory(case, "growth under a clock"), undriven(case)
    if points == 0:
        return None
    delta_crit = theory.prediction.delta_crit
    end = 1.25 * delta_crit if delta_crit is not None else case.run.analysis.delta_max
    t_d = theory.system.delay.t_d  # a clock faster than the delay is another map
    deltas = t_d + np.linspace((end - t_d) / points, end - t_d, points)
    measured, predicted = zip(*(_growth(case, theory.system, plant, float(delta)) for delta in deltas), strict=True)
    return Growth(deltas, np.array(measured), np.array(predicted))


def _growth(case: Case, system: ErrorSystem, plant: PlantKind, delta: float) -> tuple[float, float]:
    with np.errstate(over="ignore", invalid="ignore"):
        phi = system.phi(delta)
    if not np.isfinite(phi).all():  # something grows so fast that no number holds it
        return float("nan"), float("nan")
    eigenvalues, vectors = np.linalg.eig(phi)
    dominant = int(np.argmax(np.abs(eigenvalues)))
    w = SIZE * np.real(vectors[:, dominant]) / np.linalg.norm(np.real(vectors[:, dominant]))
    try:
        fly = open_loop(case, plant, trigger=ClockTrigger(delta), duration=(LEAST_INTERVALS + 0.5) * delta)
    except SimulationError:  # six intervals are shorter than a timestep
        return float("nan"), float(np.abs(eigenvalues[dominant]))
    x, x_o, x_h = system.start(w)
    states = []
    for i in range(LEAST_INTERVALS):
        flight = fly(x, x_o, x_h, i * delta)
        if flight.outcome is not None:
            break
        x, x_o, x_h = flight.x, flight.x_o, flight.x_h if system.delay else flight.x_o
        states.append(reduced_states(x, x_o, system.T_hat, x_h if system.delay else None))
    return growth_per_interval(np.array(states).reshape(-1, len(w))), float(np.abs(eigenvalues[dominant]))
