"""The prediction of every shipped case, Δ_crit's definition, and eigenstructures that have no usable inverse."""

import numpy as np
import pytest
from theory_cases import SHIPPED, neglected, pendulum_design, shipped

from icmj import EventTrigger, output_weight, zero_order
from icmj.errors import AnalysisError
from icmj.theory.crossing import Crossing
from icmj.theory.eigenstructure import ILL_CONDITIONED, compute_eigenstructure
from icmj.theory.error_system import error_system
from icmj.theory.locus import follow_locus
from icmj.theory.prediction import find_critical_crossing, predict

PUBLISHED = {  # Δ_crit, its eigenvalue, the largest other one, whether there is a cycle, and its stability
    "b=0.8": (1.807, 1, 0.268, True, "attracting"),
    "b=1.2": (1.528, -1, 0.221, True, "attracting"),
    "b=1.7": (1.112, -1, 1.20, False, "repelling"),
    "b=0.9 three-link": (0.7594, 1, 0.438, True, "attracting"),
    "b=1.1 three-link": (0.7351, -1, 0.531, True, "attracting"),
    "zeta=0.1": (3.593, 1, 0.0238, True, "attracting"),
    "zeta=0.5": (2.169, 1, 0.144, True, "attracting"),
}


def prediction(case, q_t=0.01):
    system = shipped(case)
    return predict(system, EventTrigger(output_weight(system.design), q_t), delta_max=4.5 if "zeta" in case else 3.0)


@pytest.mark.parametrize("case", PUBLISHED)
def test_published_cases(case):
    delta, eigenvalue, largest_other, cycle, verdict = PUBLISHED[case]
    p = prediction(case)
    assert p.delta_crit == pytest.approx(delta, abs=6e-4 if delta > 1 else 6e-5)
    assert p.eigenvalue == eigenvalue
    (critical,) = (crossing for crossing in p.crossings if crossing.delta == p.delta_crit)
    assert critical.direction == ("falling" if case == "b=1.7" else "rising")
    assert critical.largest_other == pytest.approx(largest_other, abs=5e-3 if case == "b=1.7" else 6e-4)
    assert critical == p.crossings[0] or case == "b=1.7"  # where a complex pair comes first
    assert p.cycle is cycle
    assert p.verdict == verdict
    expected = (p.delta_crit if eigenvalue == 1 else 2 * p.delta_crit) if cycle else None
    assert p.period == expected
    assert p.observer_feedback_stable is True
    assert p.state_feedback_stable is (case != "zeta=0.1")
    assert p.orbit is not None
    assert p.gamma == p.orbit.gamma
    np.testing.assert_array_equal(p.amplitude, p.orbit.y_peak)


def test_the_exact_model_predicts_nothing():
    p = prediction("exact")
    assert (p.delta_crit, p.eigenvalue, p.period, p.gamma, p.amplitude, p.orbit) == (None,) * 6
    assert (p.multipliers, p.V_inv, p.verdict, p.cycle, p.crossings) == (None, None, "none", False, ())
    assert follow_locus(shipped("exact"), 3.0).largest.max() < 1


def test_continuous_poles_of_the_neglected_dynamics():
    for zeta, unstable in ((0.1, True), (0.5, False)):
        plant, design = neglected(zeta), pendulum_design()
        k = design.k @ np.eye(2, 4)
        poles = np.linalg.eigvals(plant.A - plant.B @ k)
        assert (poles.real.max() > 0) == unstable == (not prediction(f"zeta={zeta}").state_feedback_stable)
        if unstable:
            assert np.abs(poles - (0.50 + 9.92j)).min() < 6e-3  # notes, section 4


@pytest.mark.parametrize("case", PUBLISHED)
def test_chi_isolates_the_critical_mode(case):
    p = prediction(case)
    V_inv, orbit = p.V_inv, p.orbit
    chi = V_inv @ orbit.x_bar
    assert chi[0] == pytest.approx(orbit.gamma, rel=1e-9)
    assert np.abs(chi[1:]).max() < 1e-8 * orbit.gamma
    assert p.v_condition < ILL_CONDITIONED
    phi = shipped(case).phi(orbit.delta)
    diagonal = V_inv @ phi @ np.linalg.inv(V_inv)
    assert np.abs(diagonal - np.diag(np.diag(diagonal))).max() < 1e-8
    assert diagonal[0, 0] == pytest.approx(orbit.sign, abs=1e-9)


def crossing(delta, kind, direction, other):
    return Crossing(delta, {"+1": 1, "-1": -1, "complex": 1j}[kind], kind, direction, other)


def test_delta_crit_follows_its_definition():
    pair = crossing(0.4, "complex", "rising", 0.5)
    falling = crossing(0.5, "+1", "falling", 0.5)
    crowded = crossing(0.6, "-1", "rising", 1.2)
    good = crossing(0.7, "-1", "rising", 0.9)
    assert find_critical_crossing((pair, falling, crowded, good)) == (good, True)
    assert find_critical_crossing((pair, falling, crowded)) == (falling, False)
    assert find_critical_crossing((pair, crowded)) == (crowded, False)
    assert find_critical_crossing((pair,)) == (None, False)
    assert find_critical_crossing(()) == (None, False)


def random_similarity(rng, size):
    return np.linalg.qr(rng.normal(size=(size, size)))[0] @ np.diag(2 ** rng.uniform(-1, 1, size))


@pytest.mark.parametrize("gap", [0.0, 1e-14, 1e-11, 1e-9])
def test_a_defective_phi_gets_a_schur_form_and_says_so(gap):
    """A Jordan block beside the critical eigenvalue: V is singular, the critical row must not suffer."""
    rng = np.random.default_rng(2)
    J = np.array([[1, 0, 0, 0], [0, 0.5, 1, 0], [0, 0, 0.5 + gap, 0], [0, 0, 0, -0.3]])
    for _ in range(20):
        S = random_similarity(rng, 4)
        phi = S @ J @ np.linalg.inv(S)
        found = compute_eigenstructure(phi, 1)
        assert found.condition > ILL_CONDITIONED
        assert not found.diagonal
        W = found.V_inv
        np.testing.assert_allclose(W[0] @ phi, W[0], atol=1e-12)  # left eigenvector
        v = S[:, 0] / np.linalg.norm(S[:, 0])
        v = v * np.sign(v[np.abs(v).argmax()])
        np.testing.assert_allclose(W @ v, [1, 0, 0, 0], atol=1e-12)
        np.testing.assert_allclose(W[1:] @ W[1:].conj().T, np.eye(3), atol=1e-12)
        assert np.linalg.cond(W) < 100


def test_a_well_conditioned_phi_is_diagonalised():
    rng = np.random.default_rng(3)
    S = random_similarity(rng, 4)
    phi = S @ np.diag([0.5, -1, 0.2, -0.7]) @ np.linalg.inv(S)
    found = compute_eigenstructure(phi, -1)
    assert found.diagonal
    W = found.V_inv
    np.testing.assert_allclose(W @ phi @ np.linalg.inv(W), np.diag([-1, -0.7, 0.5, 0.2]), atol=1e-12)


def test_a_defective_critical_eigenvalue_has_no_chi():
    phi = np.array([[1.0, 1, 0], [0, 1, 0], [0, 0, 0.5]])
    found = compute_eigenstructure(phi, 1)
    assert found.V_inv is None
    assert found.condition > 1e12


def test_another_hold_and_its_exact_system():
    """The zero-order hold through the same path: φ is the sampled-data loop in closed form for a scalar plant."""
    from icmj.controller.design import Design
    from icmj.plant.linear_plant import LinearPlant

    plant = LinearPlant([[1.0]], [[1.0]], [[1.0]])
    design = Design(plant, [[3.0]], [[4.0]])
    system = error_system(plant, design, zero_order(design))
    p = predict(system, EventTrigger([[1.0]], 0.01), delta_max=2.0)
    # x(Δ) = e^Δ x − 3(e^Δ − 1) x: the eigenvalue 3 − 2e^Δ reaches −1 at ln 2; the observer's is e^{−3Δ}
    assert p.delta_crit == pytest.approx(np.log(2), rel=1e-12)
    assert p.eigenvalue == -1
    assert p.crossings[0].largest_other == pytest.approx(1 / 8, rel=1e-10)
    shown = follow_locus(system, 2.0)
    branch = shown.eigenvalues[:, np.abs(shown.eigenvalues[-1]).argmax()]
    np.testing.assert_allclose(branch, 3 - 2 * np.exp(shown.delta), rtol=1e-9)


@pytest.mark.parametrize("case", SHIPPED)
def test_the_threshold_scales_the_orbit_and_nothing_else(case):
    small, large = prediction(case, 1e-4), prediction(case, 1.0)
    assert small.delta_crit == large.delta_crit
    assert small.verdict == large.verdict
    if small.gamma is not None:
        assert large.gamma == pytest.approx(1e4 * small.gamma, rel=1e-9)
        np.testing.assert_allclose(small.multipliers, large.multipliers, atol=1e-9)


def test_bad_arguments_are_refused():
    system = shipped("b=0.8")
    with pytest.raises(AnalysisError):
        predict(system, EventTrigger(np.eye(2), 0.01), delta_max=-1.0)
    with pytest.raises(AnalysisError, match="Q_t"):
        predict(system, EventTrigger(np.eye(3), 0.01))
