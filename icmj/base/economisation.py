"""Economisation of power series (Lanczos): high powers on [0, 1] as nearly the same polynomials of a lower degree."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import comb

import numpy as np

from icmj.base.array import Array


@lru_cache(maxsize=64)
def economise(degree: int, highest: int) -> tuple[Array, Array]:
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
