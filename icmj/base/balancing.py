"""Matrices whose rows and columns have units of their own: balanced before what is computed of them is computed.

Where entries differ by orders of magnitude only because of their units, an eigenvalue or an exponential of the matrix
as it stands loses many digits, and what is small by its unit counts as zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array

SEMIDEFINITE = 1e-12
"""How far below zero an eigenvalue of :func:`compute_balanced_modes` may lie, by rounding, where none is negative."""
_ROUNDS = 8  # each halves the decades by which the largest entry of a row or column differs from 1
_TERMS = 20  # of the Taylor series of an exponential whose exponent is at most 1


def compute_balanced_modes(W: Array) -> tuple[Array, Array, Array]:
    """Scales s, eigenvalues λ and eigenvectors V of a symmetric matrix in the units of its diagonal, W = S V Λ VᵀS.

    There Λ does not depend on the units of the coordinates, so a weight that is small only by its unit is not lost in
    the rounding of others; its smallest entry tells whether W is semidefinite. S = diag(s), Λ = diag(λ).

    Args:
        W: shape (n, n).

    Returns:
        s, λ in ascending order and V by columns; shapes (n,), (n,), (n, n).
    """
    diagonal = np.abs(np.diag(W))
    scales = np.sqrt(np.where(diagonal > 0, diagonal, np.abs(W).max(initial=0.0) or 1.0))
    return scales, *np.linalg.eigh(W / scales / scales[:, None])


def choose_units(M: Array) -> tuple[Array, Array]:
    """Factors of rows and columns of M ≥ 0 that make its entries alike, whatever units it is given in; (m,) and (n,).

    They make the squared logarithms of all entries but zeros least (Curtis, Reid 1972), and then no entry larger
    than 1.
    """
    m = len(M)
    there = M > 0
    counts = np.block([[np.diag(there.sum(axis=1)), there], [there.T, np.diag(there.sum(axis=0))]])
    sizes = np.log(M, out=np.zeros(M.shape), where=there)
    factors = np.linalg.lstsq(counts, -np.concatenate([sizes.sum(axis=1), sizes.sum(axis=0)]), rcond=None)[0]
    left, right = np.exp(factors[:m]), np.exp(factors[m:])
    for _ in range(_ROUNDS):
        largest = (left[:, None] * M * right).max(axis=1)
        left = left / np.sqrt(np.where(largest > 0, largest, 1.0))
        largest = (left[:, None] * M * right).max(axis=0)
        right = right / np.sqrt(np.where(largest > 0, largest, 1.0))
    return left, right


def balance(M: Array, least: float = 0.0) -> tuple[Array, Array]:
    """S⁻¹ M S with rows and columns of like norms, and the diagonal of S: powers of two, so that no digit is lost.

    LAPACK passes over a row or column of zeros, such as an end of a chain of integrators has. What only acts on a part
    that does not act back has no rate, and its size is a matter of units: it is made no larger than what acts both
    ways, or than ``least`` where that is larger.

    Args:
        M: shape (N, N).
        least: in the unit of M; with 0, there is no such bound where nothing acts both ways.

    Returns:
        S⁻¹ M S and the diagonal of S, shapes (N, N) and (N,).
    """
    from scipy.linalg import matrix_balance

    with np.errstate(invalid="ignore"):  # scales beyond integers, among which SciPy seeks a permutation
        balanced, (scale, _) = matrix_balance(M, permute=False, separate=True)
    acts = _acts(M)
    both = acts & acts.T
    size = np.abs(balanced)
    own = max(float(size[both].max(initial=0.0)), least)
    if own > 0 and size.max(initial=0.0) > own:
        one_way, part = np.where(both, 0.0, size / own), np.ones(len(M))
        for _ in range(len(M)):  # along any chain of parts
            reached = np.exp2(np.ceil(np.log2(np.maximum((one_way * part).max(axis=1), 1.0))))
            part = np.where(both, reached, 1.0).max(axis=1)  # the states of a part together
        balanced, scale = balanced * part / part[:, None], scale * part
    return np.asarray(balanced), np.asarray(scale)


def _acts(M: Array) -> NDArray[np.bool_]:
    """Whether each state (row) is acted on by each other, itself included, by whatever way."""
    acts = np.eye(len(M)) + (M != 0)
    for _ in range(len(M).bit_length()):  # as numbers, which BLAS multiplies; truth it does not
        acts = np.minimum(acts @ acts, 1.0)
    return np.asarray(acts > 0)


def compute_exponential(M: Array) -> Array:
    """e^M, balanced first: where states differ by orders of magnitude, SciPy alone loses many digits.

    What does not act on a state, by no way through others, keeps an exact zero: round-off of x must not leak into d.
    """
    from scipy.linalg import expm

    balanced, scale = balance(M, 1.0)
    return np.where(_acts(M), expm(balanced) * (scale[:, None] / scale), 0.0)


def propagate(A: Array, x: Array, t: Array) -> Array:
    """e^(A tᵢ) xᵢ for each of several states after a time of its own [s]; shapes (n, n), (N, n), (N,) → (N, n).

    Whole multiples of 1/‖A‖ are steps of powers of two, the same for all; the rest is a Taylor series.
    """
    balanced, scale = balance(A, 1.0 / max(float(t.max(initial=0.0)), np.finfo(float).tiny))
    rate = float(np.linalg.norm(balanced, 2))
    unit = 1.0 / rate if rate > 0 else np.inf
    whole, rest = np.divmod(t, unit)
    part = result = x / scale
    for order in range(1, _TERMS):
        part = part @ balanced.T * (rest / order)[:, None]
        result = result + part
    step: Array | None = None
    while whole.any():
        step = compute_exponential(balanced * unit) if step is None else step @ step
        odd = whole % 2 == 1
        result[odd] = result[odd] @ step.T
        whole = np.floor(whole / 2)
    return np.asarray(result * scale)
