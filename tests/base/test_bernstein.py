"""Bernstein coefficients against SciPy's own basis."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev, Polynomial
from scipy.interpolate import BPoly

from icmj.base.bernstein import make_bernstein_matrix, make_halving_matrices
from icmj.base.economisation import economise

a = np.array([0.3, -1.2, 0.7, 0.1, -0.4])


@pytest.mark.parametrize("theta", [0.0, 0.13, 0.5, 1.0])
def test_bernstein_coefficients_are_those_of_the_basis(theta):
    curve = BPoly((make_bernstein_matrix(4) @ a)[:, None], [0, 1])
    assert curve(theta) == pytest.approx(np.polyval(a[::-1], theta), abs=1e-15)


@pytest.mark.parametrize(("half", "ends"), [(0, [0, 0.5]), (1, [0.5, 1])])
def test_halves_are_the_same_polynomial_on_each(half, ends):
    curve = BPoly((make_halving_matrices(4)[half] @ make_bernstein_matrix(4) @ a)[:, None], ends)
    for theta in np.linspace(*ends, 7):
        assert curve(theta) == pytest.approx(np.polyval(a[::-1], theta), abs=1e-15)


@pytest.mark.parametrize(("degree", "highest"), [(3, 4), (9, 14), (17, 27)])
def test_powers_economised_are_truncated_chebyshev_series(degree, highest):
    columns, bounds = economise(degree, highest)
    assert columns.shape == (degree + 1, highest - degree)
    theta = np.linspace(0, 1, 4001)
    for j, column, bound in zip(range(degree + 1, highest + 1), columns.T, bounds, strict=True):
        exact = Polynomial.basis(j).convert(kind=Chebyshev, domain=[0, 1]).truncate(degree + 1)
        rounding = 1e-16 * np.abs(column).sum()
        np.testing.assert_allclose(np.polyval(column[::-1], theta), exact(theta), rtol=0, atol=10 * rounding)
        # all terms that are left out have the same sign at 1, so the bound is reached there
        assert theta[-1] ** j - column.sum() == pytest.approx(bound, abs=10 * rounding)
