"""Certified roots and extremes of polynomials, against polynomials built from their roots."""

import numba
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

from icmj.base import roots
from icmj.base.bernstein import make_bernstein_matrix


# what is compiled for compiled code alone has no way in from Python
@numba.njit
def _first(powers, degree, F, stack, spans, at):
    return roots.first_root(powers, degree, F, stack, spans, at)


@numba.njit
def _most(powers, degree, sign, until, reached, F, stack, spans):
    return roots.largest(powers, degree, sign, until, reached, F, stack, spans)


@numba.njit
def _both(powers, degree, until, high, low, F, stack, spans):
    return roots.extend(powers, degree, until, high, low, F, stack, spans)


def room(degree):
    """``F``, and a stack and spans with nothing in them that counts."""
    return (
        make_bernstein_matrix(degree),
        np.full((roots.DEEPEST, degree + 1), np.nan),
        np.full((roots.DEEPEST, 3), np.nan),
    )


def first_root(powers, at=0.0):
    return _first(powers, len(powers) - 1, *room(len(powers) - 1), at)


def largest(powers, until=1.0, sign=1.0):
    """From what is known of the ends, as those who call it do."""
    reached = max(sign * np.polyval(powers[::-1], theta) for theta in (0.0, until))
    return _most(powers, len(powers) - 1, sign, until, reached, *room(len(powers) - 1))


def powers(*roots, sign=1.0):
    return sign * Polynomial.fromroots(roots).coef


def test_first_of_several_roots():
    p = powers(0.3, 0.6, 0.9)
    assert p[0] < 0
    assert first_root(p) == pytest.approx(0.3, abs=1e-14)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6, 1e-7])
def test_a_pair_of_close_roots_is_found_and_a_near_miss_is_no_root(gap):
    # −(θ − c)² + gap²: positive only on an interval of length 2 gap
    root = first_root(np.array([-(0.4371**2) + gap**2, 2 * 0.4371, -1.0]))
    assert root == pytest.approx(0.4371 - gap, abs=1e-15 / gap)
    assert first_root(np.array([-(0.4371**2) - gap**2, 2 * 0.4371, -1.0])) == np.inf


def test_a_touch_a_start_that_is_positive_and_the_end_count():
    assert first_root(np.array([-0.25, 1.0, -1.0])) == pytest.approx(0.5, abs=1e-7)  # (θ − ½)² is exact in binary
    assert first_root(np.array([0.0, -1.0])) == 0.0
    assert first_root(np.array([2.0, 1.0])) == 0.0
    assert first_root(np.array([-1.0, 1.0])) == pytest.approx(1.0, abs=1e-15)


def test_random_polynomials_agree_with_their_roots():
    random = np.random.default_rng(1)
    found = 0
    for _ in range(400):
        roots = random.uniform(-0.5, 1.5, random.integers(1, 7))
        p = powers(*roots)
        if p[0] >= 0:
            p = -p
        inside = roots[(roots > 0) & (roots <= 1)]
        first = first_root(p)
        if len(inside) == 0:
            assert first == np.inf
        else:
            found += 1
            assert first == pytest.approx(inside.min(), abs=1e-8)
    assert found > 200


def test_largest_is_that_of_a_dense_scan():
    random = np.random.default_rng(2)
    theta = np.linspace(0, 1, 20001)
    for _ in range(200):
        a = random.standard_normal(9) / np.cumprod(np.r_[1, np.arange(1, 9)])
        for end in (1.0, 0.37):
            scan = np.polyval(a[::-1], theta * end).max()
            exact = largest(a, end)
            assert scan - 1e-15 <= exact <= scan + 1e-7


def test_a_root_is_brents_to_round_off():
    random, rounding = np.random.default_rng(3), np.finfo(float).eps
    for _ in range(200):
        steep, at = 10 ** random.uniform(-3, 2), random.uniform(0, 1)
        p = Polynomial([-at, 1.0]) * Polynomial([steep, *random.uniform(0, 1, 12)])  # rises through its only root
        root = brentq(p, 0.0, 1.0, xtol=1e-16, rtol=4 * rounding)
        assert first_root(p.coef) == pytest.approx(root, abs=8 * rounding * np.abs(p.coef).max() / p.deriv()(at))


def test_largest_is_that_of_the_slope_s_roots():
    random = np.random.default_rng(5)
    for _ in range(500):
        degree, end = int(random.integers(1, 24)), float(random.uniform(0.05, 1))
        p = Polynomial(random.normal(size=degree + 1) * random.choice([1.0, 0.5, 0.2]) ** np.arange(degree + 1))
        roots = p.deriv().roots() if degree > 1 else np.zeros(0)
        inside = roots.real[(np.abs(roots.imag) < 1e-6) & (roots.real > 0) & (roots.real < end)]
        expected = max(p(theta) for theta in (0.0, end, *inside))
        for sign in (1.0, -1.0):
            found = largest(sign * p.coef, end, sign)
            assert found == pytest.approx(expected, abs=1e-14 * np.abs(p.coef).sum())
    assert largest(np.array([3.0, 0.0])) == 3.0
    assert largest(np.zeros(5)) == 0.0


def test_extremes_are_those_at_the_slope_s_roots_whether_a_few_terms_tell_or_all_of_them():
    random, few = np.random.default_rng(6), 0
    for _ in range(500):
        degree, end = int(random.integers(1, 28)), float(random.uniform(0.05, 1))
        decay = random.choice([1.0, 0.5, 0.1])
        p = Polynomial(random.normal(size=degree + 1) * decay ** np.arange(degree + 1))
        turns = p.deriv().roots() if degree > 1 else np.zeros(0)
        inside = turns.real[(np.abs(turns.imag) < 1e-6) & (turns.real > 0) & (turns.real < end)]
        values = [p(theta) for theta in (0.0, end, *inside)]
        few += len(inside) == 1
        found = _both(p.coef, degree, end, p(0.0), p(0.0), *room(degree))
        np.testing.assert_allclose(found, (max(values), min(values)), rtol=0, atol=1e-14 * np.abs(p.coef).sum())
        assert _both(p.coef, degree, end, 1e3, -1e3, *room(degree)) == (1e3, -1e3)
    assert few > 50


def test_the_first_root_from_a_place_on_is_the_next_after_it():
    p = powers(0.2, 0.4, 0.6, 0.8, 1.5, sign=-1.0)
    p = p if p[0] < 0 else -p
    for at, expected in ((0.0, 0.2), (0.1, 0.2), (0.3, 0.3), (0.45, 0.6), (0.7, 0.7), (0.85, np.inf)):
        assert first_root(p, at) == pytest.approx(expected, abs=1e-14)
