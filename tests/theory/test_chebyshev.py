"""Chebyshev interpolation against polynomials known in closed form."""

import numpy as np
import pytest

from icmj.theory.chebyshev import find_roots, make_coefficient_matrix, make_nodes, make_parabola_matrix


@pytest.mark.parametrize("degree", [3, 8, 24])
def test_coefficients_of_a_chebyshev_polynomial_are_a_unit_vector(degree):
    for k in range(degree + 1):
        values = np.cos(k * np.arccos(np.clip(make_nodes(degree), -1, 1)))
        np.testing.assert_allclose(make_coefficient_matrix(degree) @ values, np.eye(degree + 1)[k], atol=1e-13)


def test_zeros_of_a_chebyshev_polynomial_are_its_cosines_and_rounding_adds_none():
    found = np.sort(find_roots(np.eye(13)[12]).real)
    np.testing.assert_allclose(found, np.sort(np.cos((np.arange(12) + 0.5) * np.pi / 12)), atol=1e-14)
    np.testing.assert_allclose(find_roots(np.array([-0.5, 1.0, 1e-18, 1e-20])), [0.5])


def test_parabola_keeps_quadratics_and_takes_the_rest_away():
    x = make_nodes(8)
    quadratic = 1 - 2 * x + 3 * x**2
    np.testing.assert_allclose(make_parabola_matrix(8) @ quadratic, quadratic, atol=1e-14)
    np.testing.assert_allclose(make_parabola_matrix(8) @ np.cos(5 * np.arccos(np.clip(x, -1, 1))), 0, atol=1e-13)
