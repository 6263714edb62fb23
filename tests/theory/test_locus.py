"""Branches of the eigenvalue locus: right values, no swapping, largest magnitude."""

import numpy as np
import pytest
from scipy.linalg import expm
from theory_cases import SHIPPED, random_systems, shipped

from icmj import LinearPlant, design_lq
from icmj.errors import AnalysisError
from icmj.theory.error_system import error_system
from icmj.theory.flow import make_flow
from icmj.theory.locus import follow, follow_locus


@pytest.mark.parametrize("case", SHIPPED)
def test_values_are_the_eigenvalues_of_phi(case):
    system = shipped(case)
    result = follow_locus(system, 2.0)
    for m in range(0, len(result.delta), 17):
        expected = np.linalg.eigvals(system.phi(result.delta[m]))
        scale = np.abs(expected).max()
        # symmetric functions, so that nearly equal eigenvalues do not need to be matched
        for power in (1, 2, 3):
            assert abs((result.eigenvalues[m] ** power).sum() - (expected**power).sum()) < 1e-9 * max(1, scale**power)
        assert result.largest[m] == pytest.approx(scale, rel=1e-7)


def test_the_exact_model_s_branches_are_exponentials_of_the_design_s_poles():
    system = shipped("exact")
    result = follow_locus(system, 2.0)
    poles = np.concatenate([np.linalg.eigvals(system.design.A_c), np.linalg.eigvals(system.design.A_o)])
    for branch in result.eigenvalues.T:
        first = np.abs(np.exp(poles * result.delta[0]) - branch[0]).argmin()
        np.testing.assert_allclose(branch, np.exp(poles[first] * result.delta), atol=1e-7)


def test_branches_that_cross_are_not_swapped():
    """Two eigenvalues pass through each other, a third circles around: known in closed form, shuffled row by row."""
    delta = np.linspace(0.01, 2.0, 400)
    truth = np.column_stack([delta - 1, 1 - delta, np.exp(3j * delta) * 1.5, np.exp(-3j * delta) * 1.5])
    rng = np.random.default_rng(1)
    shuffled = np.array([rng.permutation(row) for row in truth])
    followed = follow(delta, shuffled)
    start = [int(np.abs(followed[0] - z).argmin()) for z in truth[0]]
    np.testing.assert_allclose(followed[:, start], truth, atol=1e-12)


@pytest.mark.slow
@pytest.mark.kernels
def test_branches_agree_with_a_grid_so_fine_that_no_doubt_is_left():
    compared = 0
    for system in random_systems(31, 12):
        coarse = follow_locus(system, 1.5)
        fine = 64
        step = expm(system.A_C * coarse.delta[0] / fine)
        E = np.eye(len(system.A_C))
        rows = []
        for _ in range(len(coarse.delta) * fine):
            E = step @ E
            rows.append(system.T @ E @ system.T_bar)
        delta = coarse.delta[0] / fine * np.arange(1, len(rows) + 1)
        values = np.linalg.eigvals(np.array(rows)).astype(complex)
        # all branches start at 1, so they are told apart by (λ − 1)/Δ, each taking its nearest successor
        slopes = (values - 1) / delta[:, None]
        branches = [values[0]]
        met = len(values)
        for m in range(1, len(values)):
            here = (branches[-1] - 1) / delta[m - 1]
            nearest = np.abs(here[:, None] - slopes[m]).argmin(axis=1)
            between = np.abs(slopes[m][:, None] - slopes[m]) + 10 * np.eye(len(slopes[m]))
            if between.min() < 1e-2 or len(set(nearest)) < len(nearest):
                met = m  # from here on, which is which is a convention
                break
            branches.append(values[m][nearest])
        start = [int(np.abs(coarse.eigenvalues[0] - z).argmin()) for z in branches[min(fine - 1, met - 1)]]
        for i in range(met // fine):
            expected = branches[(i + 1) * fine - 1]
            np.testing.assert_allclose(coarse.eigenvalues[i, start], expected, atol=1e-7)
            compared += 1
    assert compared > 200


def test_increments_keep_their_digits_for_short_times():
    A = np.array([[0.0, 1e4], [-3.0, -2.0]])
    for t in (1e-12, 1e-6, 1e-2, 3.0):
        increment = make_flow(A).increment(t)
        # φ₁ by an augmented exponential: (e^{At} − I) = A t φ₁(At)
        augmented = expm(np.block([[A * t, np.eye(2)], [np.zeros((2, 4))]]))[:2, 2:]
        np.testing.assert_allclose(increment, A * t @ augmented, rtol=1e-9, atol=1e-12 * np.abs(increment).max())


def test_trajectories_agree_with_the_exponential():
    system = shipped("b=0.9 three-link")
    X = np.random.default_rng(0).normal(size=18)
    t, states = make_flow(system.A_C).trajectory(X, 0.76, 100)
    assert len(t) == 129
    for i in (0, 1, 50, 128):
        np.testing.assert_allclose(states[i], expm(system.A_C * t[i]) @ X, rtol=1e-10, atol=1e-10 * abs(states).max())


def test_an_empty_range_is_refused():
    with pytest.raises(AnalysisError, match="positive end"):
        follow_locus(shipped("b=0.8"), 0.0)
    with pytest.raises(AnalysisError, match="finite and square"):
        make_flow(np.array([[np.nan]]))


def test_beyond_what_numbers_hold_there_is_no_locus():
    plant = LinearPlant(np.array([[0.0, 1.0], [9e4, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]))
    system = error_system(plant.scaled(0.9), design_lq(plant, R_c=0.1, R_o=0.01))
    found = follow_locus(system, 5.0, points=64)
    assert 0.5 < found.delta[-1] < 4.0  # e^(300 · 5) is none
    assert np.isfinite(found.eigenvalues).all()
    with pytest.raises(AnalysisError, match="beyond all numbers"):
        follow_locus(system, 1e3, points=64)
