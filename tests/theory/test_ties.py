"""Orbits that reach several faces together, by symmetry or by chance, against the exact simulator."""

import numpy as np
import pytest
from theory_cases import random_systems, started_beside

from icmj import BoxTrigger, EventTrigger, LinearPlant, design_lq, predict
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.event_maps import compute_jacobians


def two_pendulums(gain: float) -> ErrorSystem:
    """Two equal pendulums with a spring between them, both angles read: they sway alike, and both thresholds are met.

    Swaying alike, each is the paper's pendulum.
    """
    A = [[0, 0.7, 0, 0.3], [1, 0, 0, 0], [0, 0.3, 0, 0.7], [0, 0, 1, 0]]
    B, C = np.array([[1, 0], [0, 0], [0, 1], [0, 0]]), [[0, 1, 0, 0], [0, 0, 0, 1]]
    return error_system(LinearPlant(A, B * gain, C), design_lq(LinearPlant(A, B, C), R_c=0.1, R_o=0.01))


@pytest.mark.parametrize(("gain", "attracts"), [(0.65, True), (0.8, True), (1.2, True), (1.6, False)])
@pytest.mark.parametrize("on", ["output", "state"])
def test_two_pendulums_that_sway_alike_are_judged_on_both_faces(gain: float, attracts: bool, on: str) -> None:
    system, rule = two_pendulums(gain), BoxTrigger(0.01, on, 1e-4)
    found = predict(system, rule)
    assert found.orbit.admissible, found.orbit.reason
    assert len(compute_jacobians(system, rule, found.orbit)) == 2
    assert found.verdict == ("attracting" if attracts else "repelling")
    for seed in range(2):
        assert started_beside(system, rule, found, seed)[1] == attracts


def test_faces_that_are_met_together_by_chance_are_judged_by_what_the_simulator_does() -> None:
    """A box whose thresholds are what the orbit of another rule has at its event is met on all its faces at once."""
    attracting, repelling = 0, 0
    for seed, system in enumerate(random_systems(11, 45, mismatch=0.5)):
        round_ = predict(system, EventTrigger(np.eye(system.n_hat), 0.01, 1e-4), delta_max=2.0)
        if round_.orbit is None:
            continue
        rule = BoxTrigger(np.abs(round_.orbit.e_hp[-1]), "state", 1e-4)
        found = predict(system, rule, delta_max=2.0)
        if found.verdict not in ("attracting", "repelling"):
            continue
        assert len(compute_jacobians(system, rule, found.orbit)) == system.n_hat
        if not 0.9 < np.abs(found.multipliers).max() < 1.1:
            attracting += found.verdict == "attracting"
            repelling += found.verdict == "repelling"
            assert started_beside(system, rule, found, seed)[1] == (found.verdict == "attracting"), seed
    assert attracting >= 5
    assert repelling >= 1


def test_a_face_that_is_let_go_of_where_another_is_met_makes_the_orbit_inadmissible() -> None:
    """Its error has been beyond the threshold just before, so that an event came earlier."""
    inadmissible = 0
    for system in random_systems(11, 25, mismatch=0.5):
        round_ = predict(system, EventTrigger(np.eye(system.n_hat), 0.01, 1e-4), delta_max=2.0)
        if round_.orbit is None:
            continue
        orbit = round_.orbit
        e, e_rate = orbit.e_hp[-1], system.T_t @ system.A_C @ orbit.X[-1]
        found = predict(system, BoxTrigger(np.abs(e), "state", 1e-4), delta_max=2.0)
        if (e * e_rate < 0).any():
            assert not found.orbit.admissible
            inadmissible += 1
    assert inadmissible >= 3
