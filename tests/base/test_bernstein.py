"""Bernstein coefficients against SciPy's own basis."""

import numpy as np
import pytest
from scipy.interpolate import BPoly

from icmj.base.bernstein import from_powers, halves

a = np.array([0.3, -1.2, 0.7, 0.1, -0.4])


@pytest.mark.parametrize("theta", [0.0, 0.13, 0.5, 1.0])
def test_bernstein_coefficients_are_those_of_the_basis(theta):
    curve = BPoly((from_powers(4) @ a)[:, None], [0, 1])
    assert curve(theta) == pytest.approx(np.polyval(a[::-1], theta), abs=1e-15)


@pytest.mark.parametrize(("half", "ends"), [(0, [0, 0.5]), (1, [0.5, 1])])
def test_halves_are_the_same_polynomial_on_each(half, ends):
    curve = BPoly((halves(4)[half] @ from_powers(4) @ a)[:, None], ends)
    for theta in np.linspace(*ends, 7):
        assert curve(theta) == pytest.approx(np.polyval(a[::-1], theta), abs=1e-15)
