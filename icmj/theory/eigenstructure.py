"""The coordinates χ = V⁻¹x̄ of an orbit (paper, eq. chi), and what takes their place where V cannot be inverted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, argmax_abs, argsort_descending

# an eigenvalue that is defective in exact arithmetic gives about 1e7 in rounded: the line is drawn below that
ILL_CONDITIONED = 1e6


@dataclass(frozen=True, eq=False)
class Eigenstructure:
    """Coordinates χ of x̄ in which the critical mode is separate.

    Attributes:
        V_inv: χ = V_inv @ x̄, shape (n + n̂, n + n̂), row 0 critical: on the orbit χ_0 = γ and the others are 0.
            ``None`` where the critical eigenvalue is itself defective.
        condition: condition number of the eigenvector matrix V (columns of unit norm); infinite if defective.
        diagonal: whether the rows after the first are left eigenvectors; if not they are an orthonormal basis of
            the vectors that annihilate V_{k₁}.
    """

    V_inv: NDArray[np.complex128] | None
    condition: float
    diagonal: bool


def compute_eigenstructure(phi: Array, sign: int) -> Eigenstructure:
    """Eigenstructure of φ(Δ_crit) with its eigenvalue ``sign`` = ±1 first.

    The critical row is always the left null vector w of φ ∓ I, scaled to w V_{k₁} = 1. The others come from V⁻¹,
    by falling |λ|, unless V is ill-conditioned; then from an ordered Schur form, whose first column is V_{k₁}: its
    other columns are orthogonal to it, and in these coordinates φ is triangular rather than diagonal.
    """
    size = len(phi)
    U, _, Vh = np.linalg.svd(phi - sign * np.eye(size))
    v, w = Vh[-1], U[:, -1]
    v = v * np.sign(v[argmax_abs(v)])
    values, V = np.linalg.eig(phi)
    k = int(np.abs(values - sign).argmin())
    others = [int(i) for i in argsort_descending(np.abs(values), values.real, values.imag) if i != k]
    order = np.array([k, *others])
    V = V[:, order].astype(complex)
    V[:, 0] = v
    spread = np.linalg.svd(V, compute_uv=False)
    # a defective matrix gives a V that is singular only up to rounding
    condition = float(spread[0] / spread[-1]) if spread[-1] > 0 else float("inf")
    overlap = float(w @ v)
    if abs(overlap) < 1e-10:
        return Eigenstructure(None, condition, False)
    critical = w / overlap
    if condition < ILL_CONDITIONED:
        V_inv = np.linalg.inv(V)
        diagonal = True
    else:
        V_inv = _complement(phi, v).astype(complex)
        diagonal = False
    V_inv[0] = critical
    return Eigenstructure(V_inv, condition, diagonal)


def _complement(phi: Array, v: Array) -> Array:
    """Orthonormal rows with v first, the others those of a real Schur form of φ on what is left."""
    from scipy.linalg import schur

    size = len(phi)
    # Householder: an orthonormal basis whose first vector is v
    Q = np.linalg.qr(np.column_stack([v, np.eye(size)]))[0][:, :size]
    Q[:, 0] = v
    _, Z = schur(Q[:, 1:].T @ phi @ Q[:, 1:], output="real")
    Q[:, 1:] = Q[:, 1:] @ Z
    return np.asarray(Q.T)
