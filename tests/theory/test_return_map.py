"""J against finite differences of a return map simulated in original coordinates, written here from the paper."""

import numpy as np
import pytest
from theory_cases import SHIPPED, assert_multipliers_agree, random_systems, shipped

from icmj import EventTrigger, predict
from icmj.theory.event_maps import compute_jacobians, compute_multipliers


@pytest.mark.parametrize("case", [c for c in SHIPPED if c != "exact"])
@pytest.mark.parametrize("weight", ["identity", "output"])
def test_shipped_cases_agree_with_finite_differences(case, weight):
    system = shipped(case)
    C = system.design.plant.C
    trigger = EventTrigger(np.eye(system.n_hat) if weight == "identity" else C.T @ C, 0.01)
    assert_multipliers_agree(system, trigger, predict(system, trigger, delta_max=4.0))


@pytest.mark.slow
def test_random_plants_agree_with_finite_differences():
    tested = 0
    for system in random_systems(99, 400):
        trigger = EventTrigger(np.eye(system.n_hat), 0.01)
        prediction = predict(system, trigger, delta_max=2.0)
        if prediction.verdict in ("attracting", "repelling"):
            assert_multipliers_agree(system, trigger, prediction)
            tested += 1
        if tested == 40:
            break
    assert tested == 40


def test_the_published_failure_is_repelling():
    system = shipped("b=1.7")
    prediction = predict(system, EventTrigger(np.eye(2), 0.01))
    assert prediction.verdict == "repelling"
    assert np.abs(prediction.multipliers).max() == pytest.approx(1.19, abs=0.005)  # notes, section 3


def test_a_grazing_event_has_no_jacobian():
    system = shipped("b=0.8")
    trigger = EventTrigger(np.eye(2), 0.01)
    orbit = predict(system, trigger).orbit
    X = orbit.X[-1]
    velocity = system.T_t @ system.A_C @ X
    # Q_t that sees only the direction across e' and e: E is stationary there
    e = system.T_t @ X
    across = np.array([-velocity[1], velocity[0]])
    blind = EventTrigger(np.outer(across, across), 0.01)
    assert across @ e != 0
    assert np.isnan(compute_jacobians(system, blind, orbit)[0]).all()


def test_multipliers_come_by_falling_magnitude():
    J = np.diag([0.1, -2.0, 0.5])
    np.testing.assert_allclose(compute_multipliers(J), [-2.0, 0.5, 0.1])
