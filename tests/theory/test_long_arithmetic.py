"""Matrices with twice the digits of a float, against exact numbers."""

from fractions import Fraction

import numpy as np
import pytest

from icmj.theory.flow import make_flow
from icmj.theory.long_arithmetic import LongArray, lengthen_flow, settle


def exactly(M):
    """The very numbers of an array, as fractions; of both parts of a long one."""
    if isinstance(M, LongArray):
        return exactly(M.high) + exactly(M.low)
    return np.array([Fraction(float(x)) for x in M.flat], object).reshape(M.shape)


def largest(M):
    return max(abs(x) for x in M.flat)


@pytest.mark.parametrize("n", [1, 5, 36])
def test_products_and_sums_have_twice_the_digits_of_a_float(n):
    rng = np.random.default_rng(n)
    A, B = (rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-3, 3, (n, 1)) for _ in range(2))
    zero = np.zeros((n, n))
    a, b = LongArray(A, zero), LongArray(B, zero)
    product = a @ b
    error = exactly(product) - exactly(A) @ exactly(B)
    assert largest(error) < Fraction(1e-26) * Fraction(float(np.abs(A).max() * np.abs(B).max() * n))
    total = product + B + a
    error = exactly(total) - (exactly(product) + exactly(B) + exactly(A))
    assert largest(error) < Fraction(1e-30) * largest(exactly(total))
    scaled = product.times(np.full((n, n), 1 / 3))
    error = exactly(scaled) - exactly(product) * Fraction(1 / 3)
    assert largest(error) < Fraction(1e-30) * largest(exactly(product))


@pytest.mark.parametrize("rate", [0.3, 40.0])
def test_a_long_flow_is_that_of_seventy_digits(rate):
    flint = pytest.importorskip("flint", reason="arithmetic of 70 digits")
    flint.ctx.dps = 70
    A = np.random.default_rng(1).normal(size=(12, 12))
    A *= rate / np.linalg.norm(A, 2)
    t = np.array([0.0, 1e-9, 0.3, 1.0])
    found = lengthen_flow(make_flow(A)).increment(t)

    def matrix(M):
        return flint.arb_mat([[flint.arb(float(x)) for x in row] for row in M])

    for i, at in enumerate(t):
        exact = (matrix(A) * flint.arb(float(at))).exp() - matrix(np.eye(12))
        off = exact - matrix(found.high[i]) - matrix(found.low[i])
        size = np.abs(found.high[i]).max()
        assert max(abs(float(x.mid())) for row in off.tolist() for x in row) <= 1e-24 * size


def test_eigenvalues_that_a_float_loses_are_found():
    """Whole numbers, similar to 1, 2, … 10 by whole numbers; floats have their eigenvalues to 1e-5 at best."""
    n, rng = 10, np.random.default_rng(3)
    exact = np.diag(np.arange(1, n + 1)).astype(object)
    while max(abs(x) for x in exact.flat) < 10**9:
        (i, j), k = rng.choice(n, 2, replace=False), int(rng.integers(-1, 2))
        exact[i] += k * exact[j]
        exact[:, j] -= k * exact[:, i]
    high = exact.astype(float)
    given = LongArray(high, np.zeros((n, n)))
    [settled] = settle(given)
    wanted = np.arange(1, n + 1)
    assert np.abs(np.sort_complex(np.linalg.eigvals(high)) - wanted).max() > 1e-5
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(settled)), wanted, rtol=0, atol=1e-12)
    assert settle(high)[0] is high
