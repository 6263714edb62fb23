"""Polynomials on [0, 1] in Bernstein form: the matrices that lead to it and halve it, and their maxima.

A polynomial lies in the convex hull of its Bernstein coefficients, so these bound it without sampling it; halving
the interval makes the bound converge quadratically. Points of R^r work alike: the norm of a polynomial curve is at
most the largest norm of its control points. That is how a whole integration step is decided at once. First roots and
extremes are found so in compiled code (:mod:`icmj.base.roots`), and here the maxima of many polynomials at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np

from icmj.base.array import Array


@lru_cache(maxsize=64)
def make_bernstein_matrix(degree: int) -> Array:
    """Matrix from power coefficients a_j (of θ^j) to Bernstein coefficients, shape (degree + 1, degree + 1).

    All entries lie in [0, 1], so the conversion in this direction loses no accuracy.
    """
    return np.array([[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)])


@lru_cache(maxsize=64)
def make_halving_matrices(degree: int) -> tuple[Array, Array]:
    """De Casteljau's matrices from the coefficients on [0, 1] to those on [0, ½] and [½, 1]."""
    left = np.array([[comb(i, j) / 2.0**i for j in range(degree + 1)] for i in range(degree + 1)])
    return left, left[::-1, ::-1].copy()


@dataclass(frozen=True, eq=False)
class Maxima:
    """Largest value of each group of polynomials.

    Attributes:
        value: shape (G,).
        cell: index of the polynomial that attains it, shape (G,).
        s: where on [0, 1] in that cell, shape (G,).
    """

    value: Array
    cell: np.ndarray
    s: Array


def find_maxima(coefficients: Array, tolerance: float = 1e-14) -> Maxima:
    """Maximum over all cells of each group.

    Args:
        coefficients: by rising power of s ∈ [0, 1], shape (d + 1, cells, groups).
        tolerance: gap between bound and value at which to stop, relative to the largest coefficient of the group.

    Returns:
        for each group the largest value, its cell and its place.
    """
    d, cells, groups = coefficients.shape[0] - 1, coefficients.shape[1], coefficients.shape[2]
    ends = np.concatenate([coefficients[0], coefficients.sum(axis=0)])  # values at both ends of every cell
    at = ends.argmax(axis=0)
    value = ends[at, np.arange(groups)]
    cell, s = at % cells, (at >= cells).astype(float)
    size = np.abs(coefficients)
    slack = tolerance * size.max(axis=(0, 1))
    # most cells fall to this cheap bound, before any Bernstein coefficient is computed
    index, group = np.nonzero(coefficients[0] + size[1:].sum(axis=0) > value + slack)
    b = make_bernstein_matrix(d) @ coefficients[:, index, group]
    start, width = np.zeros(b.shape[1]), 1.0
    left, right = make_halving_matrices(d)
    for _ in range(60):
        open_ = b.max(axis=0) > value[group] + slack[group]
        if not open_.any():
            break
        b, group, index, start = b[:, open_], group[open_], index[open_], start[open_]
        b = np.concatenate([left @ b, right @ b], axis=1)
        width /= 2
        start = np.concatenate([start, start + width])
        group, index = np.tile(group, 2), np.tile(index, 2)
        middle = b[0]
        # ascending order, so that the last write to a group is its best
        order = np.argsort(middle, kind="stable")
        better = order[middle[order] > value[group[order]]]
        value[group[better]] = middle[better]
        cell[group[better]] = index[better]
        s[group[better]] = start[better]
    return Maxima(value, cell, s)
