"""Eigenvalues of φ(Δ) for many Δ at once, and those of one crossing with how fast they move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.errors import AnalysisError
from icmj.theory.circle import TOGETHER, Spectrum, sort_outwards
from icmj.theory.crossing import Kind
from icmj.theory.flow import Flow, make_flow
from icmj.theory.invariant_subspaces import are_together
from icmj.theory.long_arithmetic import LongFlow, lengthen_flow, settle
from icmj.theory.reduction import Reduction

_CHUNK = 4_000_000  # entries of G worked on at once
_EQUAL = 1e-11  # eigenvalues of G this close, relative to it, are equal to rounding
_DEFECT = 1e-12  # relative: an error of G that may make several of a defective one
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

    With an ``error``, of the system with every entry off by that much of its row. ``long`` has φ computed in long
    arithmetic.
    """

    def __init__(self, reduced: Reduction, error: float = 0.0, *, long: bool = False) -> None:
        flow, self.left, self.right, self.t_d = reduced.flow, reduced.left, reduced.right, reduced.t_d
        if error:
            draw = np.random.default_rng(0).choice
            A, right = (
                M + error * np.linalg.norm(M, axis=1, keepdims=True) * draw([-1.0, 1.0], M.shape)
                for M in (reduced.A, reduced.right)
            )
            flow, self.right = make_flow(A), right if self.t_d else self.right  # of zeros and ones without a delay
        self.flow: Flow | LongFlow = lengthen_flow(flow) if long else flow
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
            [F] = settle(F)
            G = F / np.where(delta[a] == 0, 1.0, delta[a])[..., None, None]
            G[delta[a] == 0] = at_zero
            spectra[a] = sort_outwards(_eigenvalues(G), delta[a])
            size[a] = np.abs(F).max(axis=(1, 2, 3))
        return delta, spectra, size

    def at(self, delta: Array) -> Spectrum:
        """Spectra of G sorted outwards at each Δ > 0, shape (M,) → (M, m)."""
        [F] = settle(self.left @ self.flow.increment(delta - self.t_d) @ self.right + self._jump)
        return sort_outwards(_eigenvalues(F / delta[:, None, None]), delta)

    def _same(self, G: Array, g: Spectrum, i: int, delta: float) -> NDArray[np.bool_]:
        """Whether each eigenvalue equals the i-th, within rounding or the effect of rounding on a defective one."""
        distance, size = np.abs(g - g[i]), float(np.abs(G).max())
        same = distance < _EQUAL * size
        for j in np.flatnonzero(~same & (distance * delta < TOGETHER)):
            same[j] = are_together(G, complex(g[j]), complex(g[i]), _DEFECT * size)
        return same

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
        rate = self.left @ (self.flow.A_C @ (self.right + F @ self.right))
        G, rate = settle(self.left @ F @ self.right + self._jump, rate)
        G = G / delta
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
        if kind == "complex":  # of a pair that is near the real axis the other one is not the same
            same &= g.imag > 0
        count = int(same.sum())
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
