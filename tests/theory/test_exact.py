"""An exact model: what it promises with the system-matched hold, and that another hold does not promise it."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from theory_cases import pendulum, pendulum_design, random_systems

from icmj import Controller, EventTrigger, Settings, predict, system_matched, zero_order
from icmj.linear.run import simulate
from icmj.theory.error_system import ErrorSystem, error_system


def intervals(system: ErrorSystem, seed: int, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """The intervals of a run of a system whose model is exact, and the observer's error at its start."""
    rng, zero = np.random.default_rng(seed), np.zeros(system.n)
    x0 = 0.02 * rng.normal(size=system.n)
    rule = EventTrigger(np.eye(system.n_hat), 0.01, 1e-4)
    controller = Controller(system.design, system_matched(system.design), rule)
    settings = Settings(duration=duration, record_interval=1e3, limit=1e9)
    return simulate(system.actual, controller, settings, x0=x0, x_o0=zero).events.interval, -x0


def test_in_the_long_run_the_intervals_grow_though_each_need_not_be_longer_than_the_one_before():
    shorter = 0
    for seed, system in enumerate(random_systems(7, 25, mismatch=0.0)):
        assert predict(system, EventTrigger(np.eye(system.n_hat), 0.01), delta_max=5.0).crossings == ()
        found, error = intervals(system, seed, 20.0)
        assert len(found) >= 3
        A, A_o, t = system.actual.A, system.design.A_o, 0.0
        for interval in found[:-1]:  # of the last one rounding is much of what grows
            rest = expm(A_o * t) @ error
            if interval > 1e-4 * (1 + 1e-9):
                size = np.linalg.norm((expm(A * interval) - expm(A_o * interval)) @ rest)
                assert size == pytest.approx(0.01, rel=1e-5)
            t += interval
        shorter += bool((np.diff(found) < 0).any())
        assert found[-1] == found.max()
    assert shorter >= 5


def test_with_a_zero_order_hold_an_exact_model_has_the_critical_interval_of_sampled_control():
    plant, design = pendulum(), pendulum_design()

    def determinant(delta: float) -> float:
        sampled = expm(np.block([[plant.A * delta, plant.B * delta], [np.zeros((1, 3))]]))
        return float(np.linalg.det(sampled[:2, :2] - sampled[:2, 2:] @ design.k + np.eye(2)))

    found = predict(error_system(plant, design, zero_order(design)), EventTrigger(np.eye(2), 0.01))
    assert found.eigenvalue == -1
    assert found.delta_crit == pytest.approx(brentq(determinant, 0.5, 0.9, xtol=1e-14), rel=1e-10)
    assert found.delta_crit == pytest.approx(0.708954, abs=5e-7)
