"""Eigenvalues of φ(Δ) at the unit circle: test functions, spectra, and crossings as records.

Test functions whose zeros in Δ are the crossings of the unit circle, and the eigenvalues of which these are made.

Symmetric functions of all eigenvalues are analytic in Δ; so are those of any set that stays apart from the rest. Over a
short panel most eigenvalues stay well inside the circle or well outside. Only the others, the *near* ones, can cross it
there, and the functions made of them alone are few factors long and quickly resolved. See :mod:`icmj.theory.crossings`.

A panel is a stretch of Δ so short that the test functions on it are Chebyshev polynomials.

The crossing: where an eigenvalue of φ(Δ) meets the unit circle, as a record.

Eigenvalues of φ(Δ) for many Δ at once, and those of one crossing with how fast they move.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.errors import AnalysisError
from icmj.theory.chebyshev import coefficients, parabola
from icmj.theory.error_system import flow
from icmj.theory.reduction import Reduction

Kind = Literal["+1", "-1", "complex"]
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
        factors = _replace_stuck(factors, size, rounding)
        size = np.abs(factors)
    tiny = np.finfo(float).tiny
    size = np.maximum(size, tiny)
    sign = np.prod(factors / size, axis=-1).real
    floor = _FLOOR * size.max(axis=-2, keepdims=True)
    trend = np.log(size**2 + floor**2).sum(axis=-1) / 2
    log = np.log(size).sum(axis=-1) - trend @ parabola(delta.shape[-1] - 1).T
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


def height_of(g: Spectrum, delta: Array) -> Array:
    """(|λ|² − 1)/(2Δ): positive outside, negative inside, at Δ = 0 the real part of g."""
    return np.asarray(g.real + delta[..., None] * (g.real**2 + g.imag**2) / 2)


def outside(g: Spectrum, delta: Array) -> NDArray[np.int_]:
    """Number of eigenvalues outside the circle at each node (at Δ = 0: about to be)."""
    return np.asarray((2 * g.real + delta[..., None] * np.abs(g) ** 2 > 1e-10).sum(axis=-1))


def outwards(g: Spectrum, delta: Array) -> Spectrum:
    """Eigenvalues of G by falling distance from the circle, those outside first; last axis sorted."""
    return np.take_along_axis(g, np.argsort(-height_of(g, delta), axis=-1), axis=-1)


def near(g: Spectrum, delta: Array) -> NDArray[np.intp]:
    """Range of the eigenvalues of each panel that may reach the circle: first and one past the last, shape (P, 2).

    Args:
        g: sorted by :func:`outwards`, shape (P, nodes, m).
        delta: shape (P, nodes).
    """
    height = height_of(g, delta)
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


def away(g: Spectrum, delta: Array) -> Array:
    """Logarithms of the three test functions of eigenvalues that should stay on one side, shape (3, nodes).

    If they do, these are as smooth as the eigenvalues' symmetric functions. A visit to the circle between two nodes,
    however short, makes a logarithmic singularity, and their Chebyshev coefficients no longer decay.
    """
    d, tiny = delta[:, None], np.finfo(float).tiny
    i, j = _pairs(g.shape[-1])
    g_i, g_j = g[:, i], g[:, j]
    return np.array([np.log(np.abs(f) + tiny).sum(axis=1) for f in (g, 2 + d * g, g_i + g_j + d * g_i * g_j)])


def once(g: Spectrum) -> Spectrum:
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


def series(g: Spectrum, delta: Array) -> dict[Kind, Array]:
    """Chebyshev coefficients of the test functions of the near eigenvalues on one panel; none where there are none."""
    if not g.shape[-1]:
        return {}
    g = once(g)
    return {kind: coefficients(DEGREE) @ circle_function(kind, g, delta) for kind in KINDS}


def quiet(g: Spectrum, delta: Array) -> bool:
    """Whether eigenvalues that are on one side of the circle at every node stay there between the nodes."""
    return not g.shape[-1] or bool(np.abs(away(g, delta) @ coefficients(DEGREE)[-3:].T).max() < _QUIET)


def tail(c: Array) -> float:
    return float(np.abs(c[-3:]).max() / np.abs(c).max())


Direction = Literal["rising", "falling", "tangent"]


@dataclass(frozen=True)
class Crossing:
    """One crossing of the unit circle by an eigenvalue of φ(Δ), or by several equal ones together.

    Attributes:
        delta: Δ at the crossing [s].
        eigenvalue: where on the circle (the one with Im ≥ 0 of a complex pair).
        kind: ``+1``, ``-1`` or ``complex`` (a pair: Neimark–Sacker).
        direction: ``rising`` (outwards with growing Δ), ``falling`` or ``tangent``.
        largest_other: largest magnitude of the other eigenvalues there, those that cross together left out.
        multiplicity: how many equal eigenvalues (or pairs) cross together.
        dimension: of their eigenspace; less than ``multiplicity`` if they are defective.
    """

    delta: float
    eigenvalue: complex
    kind: Kind
    direction: Direction
    largest_other: float
    multiplicity: int = 1
    dimension: int = 1


@dataclass(frozen=True, eq=False)
class Search:
    """The crossings found and the range that could be resolved.

    Attributes:
        crossings: by rising Δ.
        delta_end: end of the interval searched [s]: ``delta_max``, or earlier where φ has grown so large that
            eigenvalues near the circle drown in its rounding (‖φ‖ > 1e8 in balanced coordinates).
        unresolved: first and last Δ of each part of it [s] over which the number of eigenvalues outside changes by more
            or less than the crossings found explain.
    """

    crossings: tuple[Crossing, ...]
    delta_end: float
    unresolved: tuple[tuple[float, float], ...] = ()


def change_outside(crossing: Crossing) -> int:
    """Change of the number of eigenvalues outside."""
    sign = {"rising": 1, "falling": -1, "tangent": 0}[crossing.direction]
    return sign * crossing.multiplicity * (2 if crossing.kind == "complex" else 1)


def distinct(found: list[Crossing], resolution: float) -> list[Crossing]:
    """Crossings without duplicates from neighbouring panels, or from a panel and a zoom."""
    kept: list[Crossing] = []
    for c in found:
        same = [
            k
            for k in kept[-8:]
            if k.kind == c.kind
            and abs(k.delta - c.delta) < resolution * (1 if "tangent" in (k.direction, c.direction) else 1e-3)
            and abs(k.eigenvalue - c.eigenvalue) < 1e-6
            and (k.direction == c.direction or "tangent" in (k.direction, c.direction))
        ]
        if not same:
            kept.append(c)
    return kept


_CHUNK = 4_000_000  # entries of G worked on at once
_EQUAL = 1e-11  # eigenvalues of φ this close, relative to it, are equal to rounding
# singular values below this, relative to G, belong to eigenvectors
_NULL = 1e-6
# eigenvalues that move more slowly than this times the fastest in a cluster do not cross with it
_STILL = 1e-4


@dataclass(frozen=True, eq=False)
class EigenvalueBranch:
    """The eigenvalue of φ nearest to a target, with those that equal it.

    Attributes:
        value: their mean.
        count: how many they are.
        dimension: how many independent eigenvectors they have.
        rates: d|λ|/dΔ / |λ| of each [1/s], NaN where the eigenvalue is defective, shape (count,).
        largest_other: largest magnitude of the other eigenvalues (of a complex pair neither of the two counts).
    """

    value: complex
    count: int
    dimension: int
    rates: Array
    largest_other: float


class Spectra:
    """Spectra of G(Δ) = (φ(Δ) − I)/Δ of a reduced error system; eigenvalues λ = 1 + Δg.

    With an ``error``, of the system with every entry off by that much of its row.
    """

    def __init__(self, reduced: Reduction, error: float = 0.0) -> None:
        self.flow, self.left, self.right, self.t_d = reduced.flow, reduced.left, reduced.right, reduced.t_d
        if error:
            draw = np.random.default_rng(0).choice
            A, right = (
                M + error * np.linalg.norm(M, axis=1, keepdims=True) * draw([-1.0, 1.0], M.shape)
                for M in (reduced.A, reduced.right)
            )
            self.flow, self.right = flow(A), right if self.t_d else self.right  # of zeros and ones without a delay
        self._jump = self.left @ self.right - np.eye(len(self.left))  # φ − I at Δ = t_d; zero without a delay

    @property
    def count(self) -> int:
        """Number of eigenvalues m."""
        return len(self.left)

    def panels(self, starts: Array, s: Array) -> tuple[Array, Spectrum, Array]:
        """Δ, spectra sorted outwards and size of φ − I; shapes (P, nodes), (P, nodes, m) and (P,).

        Args:
            starts: where each panel begins [s], shape (P,).
            s: nodes from there [s], shape (nodes,).
        """
        delta = starts[:, None] + s
        F_s = self.flow.increment(s) @ self.right
        F_a = self.left @ self.flow.increment(starts - self.t_d)
        at_zero = self.left @ self.flow.A_C @ self.right
        spectra = np.empty((len(starts), len(s), self.count), complex)
        size = np.empty(len(starts))
        step = max(1, _CHUNK // (len(s) * self.count**2))
        for i in range(0, len(starts), step):
            a = slice(i, i + step)
            F = (F_a[a] @ self.right + self._jump)[:, None] + (F_a[a] + self.left)[:, None] @ F_s
            G = F / np.where(delta[a] == 0, 1.0, delta[a])[..., None, None]
            G[delta[a] == 0] = at_zero
            spectra[a] = outwards(_eigenvalues(G), delta[a])
            size[a] = np.abs(F).max(axis=(1, 2, 3))
        return delta, spectra, size

    def at(self, delta: Array) -> Spectrum:
        """Spectra of G sorted outwards at each Δ > 0, shape (M,) → (M, m)."""
        G = self.left @ self.flow.increment(delta - self.t_d) @ self.right + self._jump
        return outwards(_eigenvalues(G / delta[:, None, None]), delta)

    def _same(self, G: Array, g: Spectrum, i: int, delta: float) -> NDArray[np.bool_]:
        """Whether each eigenvalue equals the i-th, within rounding or the effect of rounding on a defective one."""
        distance = np.abs(g - g[i]) * delta
        equal = distance < _EQUAL * max(1.0, float(np.abs(G).max()) * delta)
        near = distance < TOGETHER
        if near.sum() > equal.sum():
            sizes = np.linalg.svd(G - g[near].mean() * np.eye(len(G)))[1]
            if int((sizes < _NULL * max(sizes[0], 1.0)).sum()) < near.sum():
                return near
        return equal

    def _pairs_up(self, G: Array, g: Spectrum, i: int, delta: float) -> bool:
        """Whether the i-th and its conjugate are two, and not one real eigenvalue that rounding has made two of."""
        twin = int(np.abs(g - g[i].conj()).argmin())
        return abs(g[i].imag) * delta > TOGETHER or (twin != i and not self._same(G, g, i, delta)[twin])

    def branch(self, kind: Kind, delta: float) -> EigenvalueBranch | None:
        """The eigenvalue of this kind nearest to the circle; ``None`` where there is no complex pair.

        Nor is there one at ±1 where the nearest belongs to a complex pair that comes very near.
        """
        from scipy.linalg import eig

        F = self.flow.increment(delta - self.t_d)
        G = (self.left @ F @ self.right + self._jump) / delta
        g, left, right = eig(G, left=True, right=True)
        if kind == "complex":
            upper = np.array(
                [i for i in np.flatnonzero(g.imag > 0).tolist() if self._pairs_up(G, g, i, delta)], dtype=np.intp
            )
            if not len(upper):
                return None
            i = int(upper[np.abs(2 * g[upper].real + delta * np.abs(g[upper]) ** 2).argmin()])
        else:
            i = int(np.abs(g - (0.0 if kind == "+1" else -2.0 / delta)).argmin())
            if TOGETHER >= abs(g[i].imag) * delta > 0 and self._pairs_up(G, g, i, delta):
                return None
        same = self._same(G, g, i, delta)
        count = int(same.sum())
        rate = self.left @ (self.flow.A_C @ (self.right + F @ self.right))
        if count == 1:
            value, dimension, slower = g[i], 1, np.empty(0)
            w, v = left[:, i].conj(), right[:, i]
            overlap = w @ v
            rates = np.array([w @ rate @ v / overlap if abs(overlap) > 1e-12 else np.nan])
        else:
            middle = g[same].mean() if kind == "complex" else g[same].mean().real
            value, rates, slower, dimension = _cluster(G, rate, middle, count)
            count = len(rates)
        rest = same
        if kind == "complex":
            mirrored = np.argsort(np.abs(g - g[i].conj()))[: int(same.sum())]
            rest = same | np.isin(np.arange(len(g)), mirrored)
        others = np.abs(1 + delta * np.concatenate([g[~rest], slower]))
        lam = complex(1 + delta * value)
        growth = np.real(rates / lam) if lam else np.full(count, np.nan)
        return EigenvalueBranch(lam, count, dimension, growth, float(others.max(initial=0.0)))


def _cluster(G: Array, rate: Array, middle: complex, count: int) -> tuple[complex, Array, Array, int]:
    """Eigenvalues of G that lie within rounding or nearly so: those that move together, and those that stand still.

    Returns:
        mean and rates of those that move (NaN where they are defective), those that do not, dimension of the former.
    """
    U, sizes, Vh = np.linalg.svd(G - middle * np.eye(len(G)))
    dimension = max(1, int((sizes[-count:] < _NULL * max(sizes[0], 1.0)).sum()))
    W, V = U[:, -count:].conj().T, Vh[-count:].conj().T
    overlap = W @ V
    if dimension < count or np.linalg.svd(overlap)[1][-1] < _NULL:
        return middle, np.full(count, np.nan), np.empty(0), dimension
    rates, C = np.linalg.eig(np.linalg.solve(overlap, W @ rate @ V))
    values = np.diag(np.linalg.solve(C, np.linalg.solve(overlap, W @ G @ V) @ C))
    # an eigenvalue that merely stays near the circle is no part of the crossing
    moving = np.abs(rates) > _STILL * np.abs(rates).max()
    if not moving.any():
        moving[:] = True
    value = complex(values[moving].mean())
    kept = int(moving.sum())
    return value if np.iscomplexobj(middle) else value.real, rates[moving], values[~moving], kept


def _eigenvalues(G: Array) -> Spectrum:
    if not np.isfinite(G).all():
        raise AnalysisError("not analysable: φ(Δ) overflows; the plant or the gains are far too fast for this range")
    try:
        return np.linalg.eigvals(G).astype(complex)
    except np.linalg.LinAlgError as error:
        raise AnalysisError(f"not analysable: the eigenvalues of φ(Δ) cannot be computed ({error})") from error
