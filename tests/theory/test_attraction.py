"""Multipliers against simulation: started beside the orbit, does the exact simulator go back to it or leave?"""

import numpy as np
import pytest
from theory_cases import random_systems, shipped

from icmj.controller.controller import Controller
from icmj.controller.design import system_matched
from icmj.controller.trigger import EventTrigger
from icmj.linear.run import simulate
from icmj.simulation.settings import Settings
from icmj.theory.prediction import Prediction, predict

PERTURBATION = 1e-3
INTERVALS = 80


def distances(system, trigger: EventTrigger, prediction: Prediction, seed: int) -> np.ndarray:
    """Relative distance from the orbit (or its mirror image) right after each sample, from a start 1e-3 away."""
    orbit = prediction.orbit
    assert orbit is not None
    rng = np.random.default_rng(seed)
    n, m = system.n, system.n_hat
    direction = rng.normal(size=n + m)
    size = np.linalg.norm(orbit.x_bar)
    start = orbit.x_bar + PERTURBATION * size * direction / np.linalg.norm(direction)
    x, x_o, x_h = np.split(system.to_original(system.T_bar @ start), [n, n + m])
    controller = Controller(system.design, system_matched(system.design), trigger)
    settings = Settings(duration=INTERVALS * orbit.delta, record_interval=1e3, limit=1e6)
    run = simulate(system.actual, controller, settings, x0=x, x_o0=x_o, x_h0=x_h)
    events = run.events
    at = system.from_original(np.concatenate([events.x, events.x_o, events.x_o], axis=1))[:, : n + m]
    away = np.minimum(*(np.linalg.norm(at - s * orbit.x_bar, axis=1) for s in (1, -1)))
    return away / size


def attracted(distance: np.ndarray) -> bool:
    """Whether the last samples lie ten times nearer than the start."""
    return len(distance) > 10 and bool(distance[-3:].max() < PERTURBATION / 10)


@pytest.mark.slow
def test_random_orbits_attract_or_repel_as_their_multipliers_say():
    clear, repelling, disagreements = 0, 0, []
    for i, system in enumerate(random_systems(2024, 2000)):
        trigger = EventTrigger(np.eye(system.n_hat), 0.01, 1e-4)
        prediction = predict(system, trigger, delta_max=2.0)
        if prediction.verdict not in ("attracting", "repelling"):
            continue
        largest = np.abs(prediction.multipliers).max()
        if 0.9 <= largest <= 1.1:
            continue
        clear += 1
        repelling += largest > 1
        if attracted(distances(system, trigger, prediction, i)) != (largest < 1):
            disagreements.append((i, float(largest)))
        if clear == 200:
            break
    assert clear == 200
    assert repelling >= 20  # both answers are tried
    assert disagreements == []


@pytest.mark.parametrize("case", ["b=0.8", "b=1.2", "b=1.7", "b=0.9 three-link", "b=1.1 three-link", "zeta=0.1"])
def test_shipped_orbits_attract_or_repel_as_their_multipliers_say(case):
    system = shipped(case)
    trigger = EventTrigger(np.eye(system.n_hat), 0.01)
    prediction = predict(system, trigger, delta_max=4.0)
    assert attracted(distances(system, trigger, prediction, 1)) == (prediction.verdict == "attracting")
    assert (prediction.verdict == "repelling") == (case == "b=1.7")
