"""Polynomials on [0, 1] in Bernstein form: the matrices that lead to it and halve it.

A polynomial lies in the convex hull of its Bernstein coefficients, so these bound it without sampling it; halving
the interval makes the bound converge quadratically. Points of R^r work alike: the norm of a polynomial curve is at
most the largest norm of its control points. That is how a whole integration step is decided at once. First roots and
extremes are found so in compiled code (:mod:`icmj.base.roots`).
"""

from __future__ import annotations

from fractions import Fraction
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


@lru_cache(maxsize=64)
def economised(degree: int, highest: int) -> tuple[Array, Array]:
    """Each power above ``degree`` as nearly the same polynomial of that degree: its Chebyshev series, cut there.

    With the polynomials T*_n(θ) = T_n(2θ − 1), θ^j is 2^(1−2j) Σ_k C(2j, k) T*_{j−k}, the last term halved (Lanczos'
    economization of power series).

    Returns:
        power coefficients by columns, for θ^(degree + 1) to θ^highest, shape (degree + 1, highest − degree); and bounds
        of their errors on [0, 1], shape (highest − degree,).
    """
    chebyshev = [[1], [-1, 2]]
    while len(chebyshev) <= degree:
        last, before = chebyshev[-1], [*chebyshev[-2], 0, 0]
        chebyshev.append(
            [4 * up - 2 * here - then for up, here, then in zip([0, *last], [*last, 0], before, strict=True)]
        )
    columns, errors = [], []
    for j in range(degree + 1, highest + 1):
        column = [Fraction(0)] * (degree + 1)
        for n, polynomial in enumerate(chebyshev[: degree + 1]):
            share = Fraction(comb(2 * j, j - n), 2 ** (2 * j - 1) * (1 if n else 2))
            for i, coefficient in enumerate(polynomial):
                column[i] += share * coefficient
        columns.append([float(of) for of in column])
        errors.append(float(Fraction(sum(comb(2 * j, k) for k in range(j - degree)), 2 ** (2 * j - 1))))
    return np.array(columns).reshape(-1, degree + 1).T, np.array(errors)
