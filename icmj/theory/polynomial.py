"""Guaranteed maxima of many polynomials on [0, 1], by Bernstein bounds.

A polynomial lies between its smallest and largest Bernstein coefficient. Cells whose bound cannot beat the best
value found are dropped, the others halved, so that no extremum is missed however short it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers, halves


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


def maxima(coefficients: Array, tolerance: float = 1e-14) -> Maxima:
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
    b = from_powers(d) @ coefficients[:, index, group]
    start, width = np.zeros(b.shape[1]), 1.0
    left, right = halves(d)
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
