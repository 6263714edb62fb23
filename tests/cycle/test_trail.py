"""Polynomials along a curve: what they predict of one that is known, smooth or noisy, and what is interpolated."""

import numpy as np
import pytest

from icmj.cycle.trail import Trail, interpolate

STEP = 0.1


def curve(s: float) -> np.ndarray:
    """(cos s, e^{-s}, s)."""
    return np.array([np.cos(s), np.exp(-s), s])


def walked(n: int, noise: float = 0.0) -> Trail:
    random = np.random.default_rng(7)
    trail = Trail(curve(0.0))
    for i in range(1, n):
        trail.add(curve(i * STEP) + noise * random.standard_normal(3), STEP)
    return trail


def test_interpolation_is_exact_for_polynomials_of_its_degree() -> None:
    s = np.array([0.0, 0.3, 0.4, 1.1])
    values = np.column_stack([s**3 - s, 2 - s**2])
    np.testing.assert_allclose(interpolate(s, values, 0.7), [0.7**3 - 0.7, 2 - 0.7**2], atol=1e-15)


def test_the_first_step_goes_along_the_tangent() -> None:
    np.testing.assert_allclose(walked(1).predict(0.2, np.array([0.0, -1.0, 1.0])), [1.0, 0.8, 0.2])


def test_the_degree_rises_where_the_curve_is_smooth_and_falls_where_points_are_noisy() -> None:
    tangent = np.zeros(3)
    smooth, noisy = walked(20), walked(20, noise=1e-4)
    assert smooth.degree >= 8
    assert noisy.degree <= 5
    error = np.abs(smooth.predict(STEP, tangent) - curve(20 * STEP)).max()
    assert error < 1e-10
    # of a polynomial of degree d through noisy points the error is up to 2^(d + 1) times theirs
    assert np.abs(noisy.predict(STEP, tangent) - curve(20 * STEP)).max() < 100 * 1e-4
    assert [walked(n).degree for n in (1, 2, 3, 4)] == [0, 1, 2, 3]


def test_between_points_and_at_the_last_it_is_the_curve() -> None:
    trail = walked(12)
    for i in (0, 5, 10):
        np.testing.assert_allclose(trail.between(i, (i + 0.4) * STEP), curve((i + 0.4) * STEP), atol=2e-9)
    s = trail.s[-1]
    np.testing.assert_allclose(trail.slope(), [-np.sin(s), -np.exp(-s), 1.0], atol=1e-4)


def test_the_derivative_is_interpolated_between_the_points_where_it_is_known() -> None:
    trail = walked(30)
    for i in range(0, 30, 2):
        trail.derive(i, np.array([[np.cos(trail.s[i]), trail.s[i]]]))
    for s in (0.25, 0.7, 1.43):
        np.testing.assert_allclose(trail.derivative(s), [[np.cos(s), s]], atol=1e-7)
    trail.cut(7)
    assert len(trail) == 7
    assert trail.known == [0, 2, 4, 6]
    assert len(trail.D) == 4
    assert trail.derivative(0.3)[0, 1] == pytest.approx(0.3)


def test_fewer_derivatives_are_taken_where_they_are_noisy() -> None:
    random, errors = np.random.default_rng(3), []
    for noise in (0.0, 1e-3):
        trail = walked(30)
        for i in range(0, 24, 2):
            trail.derive(i, np.array([[np.cos(trail.s[i]) + noise * random.standard_normal()]]))
        errors.append(abs(trail.derivative(2.4)[0, 0] - np.cos(2.4)))
    assert errors[0] < 1e-6
    assert errors[1] < 2e-2  # eight points would magnify the noise two hundred times
