"""LQ design against its closed form, against the published-case gains, and against the Riccati equations."""

import contextlib

import control
import numpy as np
import pytest

from icmj import Design, LinearPlant, design_lq
from icmj.errors import DesignError

PENDULUM = LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]])


def test_gains_are_those_recovered_for_the_paper():
    design = design_lq(PENDULUM, R_c=0.1, R_o=0.01)
    np.testing.assert_allclose(design.k, [[4.3166, 2.9382]], atol=5e-5)
    np.testing.assert_allclose(design.L, [[4.7010], [11.0499]], atol=5e-5)


def test_gains_are_the_closed_form_of_the_double_root():
    """For 1/(s² − 1) with Q = CᵀC: A_c has s² + k₂ s + (k₁ − 1) with k₁ = 1 + √(1 + 1/R), k₂ = √(2 k₁)."""
    for R in (0.01, 0.1, 3.0):
        k_1 = 1 + np.sqrt(1 + 1 / R)
        np.testing.assert_allclose(design_lq(PENDULUM, R_c=R).k, [[k_1, np.sqrt(2 * k_1)]], rtol=1e-12)


def test_observer_is_the_dual_of_the_regulator():
    dual = LinearPlant(PENDULUM.A.T, PENDULUM.C.T, PENDULUM.B.T)
    one, other = design_lq(PENDULUM, R_o=0.02), design_lq(dual, R_c=0.02)
    np.testing.assert_allclose(one.L, other.k.T, rtol=1e-10)


@pytest.mark.parametrize("seed", range(20))
def test_gains_are_those_of_python_control_to_the_bit(seed):
    rng = np.random.default_rng(seed)
    n, n_u, n_y = rng.integers(1, 9), rng.integers(1, 4), rng.integers(1, 4)
    plant = LinearPlant(rng.normal(size=(n, n)), rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))
    R_c, R_o = np.diag(rng.uniform(1e-6, 2, n_u)), np.diag(rng.uniform(1e-6, 2, n_y))
    design = design_lq(plant, R_c=R_c, R_o=R_o)
    k, _, _ = control.lqr(plant.A, plant.B, plant.C.T @ plant.C, R_c, method="scipy")
    L, _, _ = control.lqe(plant.A, np.eye(n), plant.C, plant.B @ plant.B.T, R_o, method="scipy")
    assert np.array_equal(design.k, k)
    assert np.array_equal(design.L, L)


@pytest.mark.parametrize("seed", range(20))
def test_random_designs_solve_their_riccati_equations(seed):
    rng = np.random.default_rng(seed)
    n, n_u, n_y = rng.integers(1, 6), rng.integers(1, 3), rng.integers(1, 3)
    plant = LinearPlant(rng.normal(size=(n, n)), rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))
    R = float(rng.uniform(0.1, 2))
    design = design_lq(plant, Q_c=np.eye(n), R_c=R, Q_o=np.eye(n), R_o=R)
    assert np.linalg.eigvals(design.A_c).real.max() < 0
    assert np.linalg.eigvals(design.A_o).real.max() < 0
    # Kalman's identity: |det(1 + k (jω − A)⁻¹ B)|² exceeds 1 at every frequency
    for omega in (0.1, 1.0, 10.0):
        loop = design.k @ np.linalg.solve(1j * omega * np.eye(n) - plant.A, plant.B)
        assert abs(np.linalg.det(np.eye(n_u) + loop)) >= 1 - 1e-9


def test_plant_that_cannot_be_stabilised_and_gains_of_wrong_shape_are_refused():
    with pytest.raises(DesignError, match=r"LQ design|not stable"):
        design_lq(LinearPlant([[1, 0], [0, 2]], [[0], [1]], [[1, 1]]), Q_c=np.eye(2))
    with pytest.raises(DesignError, match="gains do not fit"):
        Design(PENDULUM, [[1, 2, 3]], [[1], [2]])


@pytest.mark.parametrize(("weights", "words"), [
    ({"Q_c": [[1, 2], [3]]}, "Q_c is not a matrix: rows differ in length"),
    ({"Q_c": np.eye(3)}, "Q_c has shape"),
    ({"Q_o": [[1, 2], [3, 4]]}, "Q_o is not symmetric"),
    ({"Q_c": [1, -1]}, "Q_c has a negative eigenvalue"),
    ({"Q_c": [1, float("nan")]}, "Q_c holds a NaN"),
    ({"R_c": 0.0}, "R_c must be positive"),
    ({"R_o": -1.0}, "R_o must be positive"),
    ({"R_c": [1.0, 2.0]}, "R_c has shape"),
    ({"Q_c": [1e300, 1e300]}, "no LQ design"),
])  # fmt: skip
def test_unusable_weights_are_named(weights, words):
    with pytest.raises(DesignError, match=words):
        design_lq(PENDULUM, **weights)


@pytest.mark.parametrize("exponent", [-300, -100, -15, 12, 100, 300])
@pytest.mark.parametrize("name", ["Q_c", "R_c", "Q_o", "R_o"])
def test_a_weight_of_any_size_gives_a_stable_design_or_one_line(name, exponent):
    scale = 10.0**exponent
    with contextlib.suppress(DesignError):
        design = design_lq(PENDULUM, **{name: [scale, scale] if name.startswith("Q") else scale})
        assert np.linalg.eigvals(design.A_c).real.max() < 0
        assert np.linalg.eigvals(design.A_o).real.max() < 0
