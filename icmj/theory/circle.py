"""Test functions of Δ whose zeros are the crossings of the unit circle by eigenvalues of φ(Δ).

Symmetric functions of all eigenvalues are analytic in Δ; so are those of any set that stays apart from the rest. Over a
short panel most eigenvalues stay well inside the circle or well outside. Only the others, the *near* ones, can cross it
there, and the functions made of them alone are few factors long and quickly resolved. See :mod:`icmj.theory.crossings`.

A panel is a stretch of Δ so short that the test functions on it are Chebyshev polynomials.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.theory.chebyshev import make_coefficient_matrix, make_parabola_matrix
from icmj.theory.crossing import Kind

KINDS: tuple[Kind, ...] = ("+1", "-1", "complex")
Spectrum = NDArray[np.complex128]

# A set stays apart from the next if the gap between them is everywhere so many times what they move between two nodes
_APART = 2.0
# eigenvalues nearer to each other than this, relative to the largest, at every node are one eigenvalue repeated
TOGETHER = 1e-6

# fills in the zeros of a factor before its logarithm is fitted, relative to its largest value on the panel
_FLOOR = 0.3
DEGREE = 24
_QUIET = 1e-3  # last Chebyshev coefficients of the logarithm of a function without zeros nearby; a zero makes 1e-1


def evaluate_circle_function(kind: Kind, g: Spectrum, delta: Array) -> Array:
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
        factors = _replace_stuck(factors, size, rounding)
        size = np.abs(factors)
    tiny = np.finfo(float).tiny
    size = np.maximum(size, tiny)
    sign = np.prod(factors / size, axis=-1).real
    floor = _FLOOR * size.max(axis=-2, keepdims=True)
    trend = np.log(size**2 + floor**2).sum(axis=-1) / 2
    log = np.log(size).sum(axis=-1) - trend @ make_parabola_matrix(delta.shape[-1] - 1).T
    return np.asarray(sign * np.exp(log - log.max(axis=-1, keepdims=True)))


def _replace_stuck(factors: Spectrum, size: Array, rounding: Array) -> Spectrum:
    """Factors with those that vanish at every node of a panel set to one."""
    order = np.argsort(size, axis=-1)
    factors = np.take_along_axis(factors, order, axis=-1)
    size = np.take_along_axis(size, order, axis=-1)
    stuck = (size <= rounding[..., None]).all(axis=-2, keepdims=True)
    return np.where(stuck, 1.0 + 0j, factors)


@cache
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(count, 1)


def measure_height(g: Spectrum, delta: Array) -> Array:
    """(|λ|² − 1)/(2Δ): positive outside, negative inside, at Δ = 0 the real part of g."""
    return np.asarray(g.real + delta[..., None] * (g.real**2 + g.imag**2) / 2)


def count_outside(g: Spectrum, delta: Array) -> NDArray[np.int_]:
    """Number of eigenvalues outside the circle at each node (at Δ = 0: about to be)."""
    return np.asarray((2 * g.real + delta[..., None] * np.abs(g) ** 2 > 1e-10).sum(axis=-1))


def sort_outwards(g: Spectrum, delta: Array) -> Spectrum:
    """Eigenvalues of G by falling distance from the circle, those outside first; last axis sorted."""
    return np.take_along_axis(g, np.argsort(-measure_height(g, delta), axis=-1), axis=-1)


def find_near(g: Spectrum, delta: Array) -> NDArray[np.intp]:
    """Range of the eigenvalues of each panel that may reach the circle: first and one past the last, shape (P, 2).

    Args:
        g: sorted by :func:`sort_outwards`, shape (P, nodes, m).
        delta: shape (P, nodes).
    """
    height = measure_height(g, delta)
    panels, _, m = height.shape
    # motion of the i-th from node to node, and the gap to the next one, at the worse of two neighbouring nodes
    moved = np.abs(np.diff(height, axis=1))
    gap = np.minimum(*_neighbours(height[..., :-1] - height[..., 1:]))
    # rounding moves each g alike, and its height by |λ| times as much
    rounding = 1e-9 * np.abs(g).max(axis=(1, 2))[:, None, None] * np.abs(1 + delta[..., None] * g)
    floor = np.maximum(*_neighbours(rounding))
    split = np.ones((panels, m + 1), dtype=bool)  # at 0 and m there is nothing on one side
    split[:, 1:m] = (gap > _APART * (moved[..., :-1] + moved[..., 1:]) + floor[..., :-1]).all(axis=1)
    clear = np.minimum(*_neighbours(np.abs(height))) > _APART * moved + floor
    count = (height > 0).sum(axis=2)
    least, most = count.min(axis=1), count.max(axis=1)
    limits = np.empty((panels, 2), dtype=np.intp)
    for i in range(panels):
        first, last = int(least[i]), int(most[i])
        if first and not clear[i, :, first - 1].all():
            first = int(np.flatnonzero(split[i, :first])[-1])
        if last < m and not clear[i, :, last].all():
            last += 1 + int(np.flatnonzero(split[i, last + 1 :])[0])
        elif first < last and not split[i, last]:
            last += int(np.flatnonzero(split[i, last:])[0])
        if first < last and not split[i, first]:
            first = int(np.flatnonzero(split[i, : first + 1])[-1])
        limits[i] = first, last
    return limits


def evaluate_away(g: Spectrum, delta: Array) -> Array:
    """Logarithms of the three test functions of eigenvalues that should stay on one side, shape (3, nodes).

    If they do, these are as smooth as the eigenvalues' symmetric functions. A visit to the circle between two nodes,
    however short, makes a logarithmic singularity, and their Chebyshev coefficients no longer decay.
    """
    d, tiny = delta[:, None], np.finfo(float).tiny
    i, j = _pairs(g.shape[-1])
    g_i, g_j = g[:, i], g[:, j]
    return np.array([np.log(np.abs(f) + tiny).sum(axis=1) for f in (g, 2 + d * g, g_i + g_j + d * g_i * g_j)])


def merge_repeated(g: Spectrum) -> Spectrum:
    """Eigenvalues without their repetitions, where the same are repeated at every node; shape (nodes, m) → (nodes, r).

    Repeated eigenvalues, of two like pendulums say, make zeros of high order, which rounding scatters. A defective one
    comes out as several close ones, whose mean is good; so the mean stands for each cluster.
    """
    m = g.shape[1]
    if m < 2:
        return g
    size = np.abs(g).max() or 1.0
    distance = np.abs(g[:, :, None] - g[:, None, :])
    if not ((distance < TOGETHER * size).sum(axis=2) > 1).any(axis=1).all():
        return g
    means, counts = [], []
    for values, apart in zip(g, distance, strict=True):
        left, here = np.arange(m), []
        while len(left):
            same = apart[left[0], left] < TOGETHER * size
            here.append((values[left[same]].mean(), int(same.sum())))
            left = left[~same]
        means.append([mean for mean, _ in here])
        counts.append([count for _, count in here])
    if all(sorted(count) == sorted(counts[0]) for count in counts):
        return np.array(means)
    # where two clusters meet at a node, each still consists of a whole number of copies
    copies = int(np.gcd.reduce(np.concatenate(counts)))
    return np.array([np.repeat(mean, np.array(count) // copies) for mean, count in zip(means, counts, strict=True)])


def _neighbours(values: Array) -> tuple[Array, Array]:
    return values[:, :-1], values[:, 1:]


def expand_near(g: Spectrum, delta: Array) -> dict[Kind, Array]:
    """Chebyshev coefficients of the test functions of the near eigenvalues on one panel; none where there are none."""
    if not g.shape[-1]:
        return {}
    g = merge_repeated(g)
    return {kind: make_coefficient_matrix(DEGREE) @ evaluate_circle_function(kind, g, delta) for kind in KINDS}


def is_quiet(g: Spectrum, delta: Array) -> bool:
    """Whether eigenvalues that are on one side of the circle at every node stay there between the nodes."""
    return not g.shape[-1] or bool(
        np.abs(evaluate_away(g, delta) @ make_coefficient_matrix(DEGREE)[-3:].T).max() < _QUIET
    )


def measure_tail(c: Array) -> float:
    return float(np.abs(c[-3:]).max() / np.abs(c).max())
