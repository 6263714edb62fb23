"""Test functions whose zeros in Δ are the crossings of the unit circle; see :mod:`icmj.theory.crossings`."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.theory.chebyshev import parabola

Kind = Literal["+1", "-1", "complex"]
KINDS: tuple[Kind, ...] = ("+1", "-1", "complex")
Spectrum = NDArray[np.complex128]

# fills in the zeros of a factor before its logarithm is fitted, relative to its largest value on the panel
_FLOOR = 0.3


def circle_function(kind: Kind, g: Spectrum, delta: Array) -> Array:
    """One test function at the Chebyshev nodes of each panel, times a positive function that flattens it.

    The product of many factors varies by many decades over a panel, and a zero where it is small would be lost.
    Its logarithm, with zeros filled in, is therefore fitted by a parabola, and the function divided by the exponential
    of that: this has no zeros and is analytic, so neither zeros nor the decay of the coefficients suffer.

    A factor that vanishes at every node belongs to an eigenvalue that stays on the circle (a mode that neither
    control nor error moves); it crosses nothing and is left out.

    Args:
        kind: which function.
        g: eigenvalues of G, shape (..., nodes, n + n̂).
        delta: Δ at the nodes [s], shape (..., nodes).
    """
    d = delta[..., None]
    if kind == "+1":
        factors = g
    elif kind == "-1":
        factors = 2 + d * g
    else:
        i, j = _pairs(g.shape[-1])
        g_i, g_j = g[..., i], g[..., j]
        factors = g_i + g_j + d * g_i * g_j
    if not factors.shape[-1]:
        return np.ones(delta.shape)
    size = np.abs(factors)
    rounding = 1e-12 * np.maximum(np.abs(g).max(axis=-1), 1.0)
    smallest = size.min(axis=-1)
    if (smallest <= rounding).all(axis=-1).any():
        factors = _without_stuck(factors, size, rounding)
        size = np.abs(factors)
    tiny = np.finfo(float).tiny
    size = np.maximum(size, tiny)
    sign = np.prod(factors / size, axis=-1).real
    floor = _FLOOR * size.max(axis=-2, keepdims=True)
    trend = np.log(size**2 + floor**2).sum(axis=-1) / 2
    log = np.log(size).sum(axis=-1) - trend @ parabola(delta.shape[-1] - 1).T
    return np.asarray(sign * np.exp(log - log.max(axis=-1, keepdims=True)))


def _without_stuck(factors: Spectrum, size: Array, rounding: Array) -> Spectrum:
    """Factors with those that vanish at every node of a panel set to one."""
    order = np.argsort(size, axis=-1)
    factors = np.take_along_axis(factors, order, axis=-1)
    size = np.take_along_axis(size, order, axis=-1)
    stuck = (size <= rounding[..., None]).all(axis=-2, keepdims=True)
    return np.where(stuck, 1.0 + 0j, factors)


@cache
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(count, 1)


def outside(g: Spectrum, delta: Array) -> NDArray[np.int_]:
    """Number of eigenvalues outside the circle at each node (at Δ = 0: about to be)."""
    return np.asarray((2 * g.real + delta[..., None] * np.abs(g) ** 2 > 1e-10).sum(axis=-1))
