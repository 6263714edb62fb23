"""Chebyshev interpolation on [−1, 1]: nodes, coefficients, zeros."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array


@cache
def make_nodes(degree: int) -> Array:
    """Chebyshev points of the second kind, rising."""
    x = -np.cos(np.pi * np.arange(degree + 1) / degree)
    x.flags.writeable = False
    return x


@cache
def make_coefficient_matrix(degree: int) -> Array:
    """Matrix from values at the nodes to Chebyshev coefficients."""
    return np.asarray(np.linalg.inv(np.polynomial.chebyshev.chebvander(make_nodes(degree), degree)))


@cache
def make_parabola_matrix(degree: int) -> Array:
    """Matrix from values at the nodes to the values of their quadratic Chebyshev part."""
    return np.asarray(np.polynomial.chebyshev.chebvander(make_nodes(degree), 2) @ make_coefficient_matrix(degree)[:3])


def find_roots(c: Array) -> NDArray[np.complex128]:
    """All zeros of the series with coefficients ``c``; closing ones below rounding are left out."""
    size = np.abs(c)
    keep = np.flatnonzero(size > 1e-15 * size.max())
    degree = int(keep[-1]) if len(keep) else 0
    return np.atleast_1d(np.polynomial.chebyshev.chebroots(c[: degree + 1])).astype(complex)
