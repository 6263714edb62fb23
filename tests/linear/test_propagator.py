"""The exact flow on a grid, against SciPy's matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from icmj.linear.propagator import Propagator


@pytest.mark.parametrize("seed", range(8))
def test_states_and_fractions_are_matrix_exponentials(seed):
    random = np.random.default_rng(seed)
    m = int(random.integers(1, 9))
    scale = np.diag(10.0 ** random.uniform(-3, 3, m))  # badly scaled states, as angles beside torques
    M = scale @ random.standard_normal((m, m)) @ np.linalg.inv(scale)
    z = scale @ random.standard_normal(m)
    flow = Propagator(M)
    Z = flow.states(z)
    assert Z.shape == (flow.block + 1, m)
    for k in (0, 1, 5, flow.block):
        exact = expm(M * flow.h * k) @ z
        assert np.abs((Z[k] - exact) / np.diag(scale)).max() < 1e-11 * np.abs(exact / np.diag(scale)).max()
    theta = np.array([0.0, 0.31, 1.0])
    within = flow.within(Z[[0, 2, 3]], theta)
    for row, k, part in zip(within, (0, 2, 3), theta, strict=True):
        exact = expm(M * flow.h * part) @ Z[k]
        assert np.abs((row - exact) / np.diag(scale)).max() < 1e-13 * np.abs(Z[k] / np.diag(scale)).max() * 10


def test_polynomial_of_an_output():
    M = np.array([[0.0, 1.0], [-4.0, -0.1]])
    C = np.array([[1.0, 0.5]])
    flow = Propagator(M)
    z = np.array([0.3, -1.0])
    a = (flow.powers_of(C) @ z)[:, 0]
    b = (flow.controls_of(C) @ z)[:, 0]
    for theta in (0.2, 0.77, 1.0):
        assert np.polyval(a[::-1], theta) == pytest.approx((C @ expm(M * flow.h * theta) @ z)[0], abs=1e-15)
    assert b[0] == pytest.approx((C @ z)[0], abs=1e-15)
    assert b[-1] == pytest.approx((C @ expm(M * flow.h) @ z)[0], abs=1e-14)


def test_a_zero_generator_stands_still():
    flow = Propagator(np.zeros((2, 2)))
    assert np.array_equal(flow.states(np.array([1.0, 2.0]))[-1], [1.0, 2.0])
