"""Polynomials on [0, 1] in Bernstein form: the matrices that lead to it and halve it.

A polynomial lies in the convex hull of its Bernstein coefficients, so these bound it without sampling it; halving
the interval makes the bound converge quadratically. Points of R^r work alike: the norm of a polynomial curve is at
most the largest norm of its control points. That is how a whole integration step is decided at once. First roots and
extremes are found so in compiled code (:mod:`icmj.base.roots`).
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from icmj.base.array import Array


@lru_cache(maxsize=64)
def from_powers(degree: int) -> Array:
    """Matrix from power coefficients a_j (of θ^j) to Bernstein coefficients, shape (degree + 1, degree + 1).

    All entries lie in [0, 1], so the conversion in this direction loses no accuracy.
    """
    return np.array([[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)])


@lru_cache(maxsize=64)
def halves(degree: int) -> tuple[Array, Array]:
    """De Casteljau's matrices from the coefficients on [0, 1] to those on [0, ½] and [½, 1]."""
    left = np.array([[comb(i, j) / 2.0**i for j in range(degree + 1)] for i in range(degree + 1)])
    return left, left[::-1, ::-1].copy()
