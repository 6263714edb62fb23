"""The error matrix against the closed loop in original coordinates, and against the matrices that the paper prints."""

import numpy as np
import pytest
from theory_cases import neglected, pendulum, pendulum_design, random_systems, shipped

from icmj import Design, error_system, system_matched, zero_order
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, deviate
from icmj.theory.crossings import search


def random_loop(rng, n=None, n_hat=None):
    n = n or rng.integers(1, 6)
    n_hat = n_hat or rng.integers(1, 6)
    n_u, n_y = rng.integers(1, 4, size=2)
    actual = LinearPlant(rng.normal(size=(n, n)), rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))
    assumed = LinearPlant(rng.normal(size=(n_hat, n_hat)), rng.normal(size=(n_hat, n_u)), rng.normal(size=(n_y, n_hat)))
    design = Design(assumed, rng.normal(size=(n_u, n_hat)), rng.normal(size=(n_hat, n_y)))
    return actual, design, rng.normal(size=(n_hat, n))


def direct(actual, design, A_h):
    """d/dt (x, x_o, x_h) written down from the plant, the observer and the hold, one at a time."""
    n, m = actual.n, design.plant.n
    M = np.zeros((n + 2 * m, n + 2 * m))
    plant, observer, hold = slice(0, n), slice(n, n + m), slice(n + m, n + 2 * m)
    M[plant, plant] = actual.A
    M[plant, hold] = -actual.B @ design.k
    M[observer, observer] = design.plant.A - design.L @ design.plant.C
    M[observer, plant] = design.L @ actual.C
    M[observer, hold] = -design.plant.B @ design.k
    M[hold, hold] = A_h
    return M


@pytest.mark.parametrize("hold", [system_matched, zero_order])
def test_equals_the_direct_matrix_under_the_coordinate_change(hold):
    rng = np.random.default_rng(11)
    for _ in range(400):
        actual, design, T_hat = random_loop(rng)
        h = hold(design)
        system = error_system(actual, design, h, T_hat)
        n, m = actual.n, design.plant.n
        S = np.eye(n + 2 * m)  # X̄ = S (x, x_o, x_h)
        S[n : n + m, :n] = S[n + m :, :n] = -T_hat
        expected = S @ direct(actual, design, h.A_h) @ np.linalg.inv(S)
        scale = max(np.abs(expected).max(), 1.0)
        assert np.abs(system.A_C - expected).max() < 1e-12 * scale
        X = rng.normal(size=(3, n + 2 * m))
        np.testing.assert_allclose(system.from_original(X), X @ S.T, atol=1e-12)
        np.testing.assert_allclose(system.to_original(system.from_original(X)), X, atol=1e-12)


def test_same_order_gives_the_matrix_printed_in_the_paper():
    rng = np.random.default_rng(12)
    for _ in range(200):
        n = int(rng.integers(1, 6))
        actual, design, _ = random_loop(rng, n, n)
        A, B, C = actual.A, actual.B, actual.C
        k, L = design.k, design.L
        A_t, B_t, C_t = design.plant.A - A, design.plant.B - B, design.plant.C - C
        A_t_co = A_t - B_t @ k - L @ C_t
        A_t_c = A_t - B_t @ k
        Z = np.zeros((n, n))
        printed = np.block(
            [[A - B @ k, Z, -B @ k], [A_t_co, design.A_o, -B_t @ k], [A_t_c, Z, A + A_t_c]]
        )  # eq. AC_smh_sens
        system = error_system(actual, design, T_hat=np.eye(n))
        assert np.abs(system.A_C - printed).max() < 1e-12 * max(np.abs(printed).max(), 1.0)


def test_exact_model_gives_the_block_triangular_matrix_of_the_paper():
    system = shipped("exact")
    A_c, A_o = system.design.A_c, system.design.A_o
    Bk = system.design.plant.B @ system.design.k
    Z = np.zeros((2, 2))
    np.testing.assert_allclose(
        system.A_C, np.block([[A_c, Z, -Bk], [Z, A_o, Z], [Z, Z, system.design.plant.A]]), atol=1e-14
    )  # eq. AC_smh


def test_jump_and_projections_do_what_their_names_say():
    system = shipped("zeta=0.1")
    X = np.random.default_rng(0).normal(size=4 + 2 * 2)
    x, x_o, x_h = np.split(system.to_original(X), [4, 6])
    after = system.to_original(system.A_D @ X)
    np.testing.assert_allclose(after, np.concatenate([x, x_o, x_o]), atol=1e-14)
    np.testing.assert_allclose(system.T_t @ X, x_h - x_o, atol=1e-14)
    np.testing.assert_allclose(system.C_u @ X, -system.design.k @ x_h, atol=1e-14)
    np.testing.assert_allclose(system.C_y @ X, system.actual.C @ x, atol=1e-14)
    np.testing.assert_allclose(system.T_bar @ (system.T @ system.A_D @ X), system.A_D @ X, atol=1e-14)


def found(system, end=2.5):
    return np.array([[c.delta, c.eigenvalue.real, c.largest_other] for c in search(system, end).crossings])


def test_crossings_do_not_depend_on_T_hat():
    rng = np.random.default_rng(3)
    design = pendulum_design()
    for actual in (pendulum(0.8), pendulum(1.7), neglected(0.5)):
        expected = found(error_system(actual, design))
        assert len(expected)
        for _ in range(5):
            other = error_system(actual, design, T_hat=rng.normal(size=(2, actual.n)))
            np.testing.assert_allclose(found(other), expected, rtol=1e-8)


def test_crossings_do_not_depend_on_the_states_chosen():
    rng = np.random.default_rng(4)
    for system in random_systems(5, 20):
        actual, assumed, design = system.actual, system.design.plant, system.design
        S = np.linalg.qr(rng.normal(size=(actual.n, actual.n)))[0] * 2 ** rng.uniform(-2, 2, actual.n)
        R = np.linalg.qr(rng.normal(size=(assumed.n, assumed.n)))[0] * 2 ** rng.uniform(-2, 2, assumed.n)
        other = Design(_changed(assumed, R), design.k @ R, np.linalg.solve(R, design.L))
        moved = error_system(_changed(actual, S), other)
        np.testing.assert_allclose(found(moved), found(system), rtol=1e-6, atol=1e-8)


def _changed(plant, S):
    return LinearPlant(np.linalg.solve(S, plant.A @ S), np.linalg.solve(S, plant.B), plant.C @ S)


def test_the_family_in_rho_runs_from_the_exact_model_to_the_actual_plant():
    design, actual = pendulum_design(), pendulum(0.8)
    at = [error_system(deviate(design.plant, actual, rho), design).A_C for rho in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(at[0], shipped("exact").A_C, atol=1e-14)
    np.testing.assert_allclose(at[1], (at[0] + at[2]) / 2, atol=1e-14)
    np.testing.assert_allclose(at[2], error_system(actual, design).A_C, atol=1e-14)


def test_plants_that_do_not_fit_are_refused():
    design = pendulum_design()
    with pytest.raises(AnalysisError, match="inputs"):
        error_system(LinearPlant(np.eye(2), np.eye(2), [[0, 1]]), design)
    with pytest.raises(AnalysisError, match="T̂ has shape"):
        error_system(pendulum(), design, T_hat=np.eye(3))
