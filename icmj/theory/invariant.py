"""Invariant subspaces that an output does not see, belonging to slow or growing modes only.

A mode that stays on or outside the imaginary axis and that no row of C sees is looked for in three steps: the
invariant subspace of all modes that do not clearly decay (ordered Schur form, so few dimensions are left), in it the
largest invariant subspace on which C vanishes, and there the split into what stays and what grows. Matrices are to be
balanced first, so that one tolerance fits all rows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from icmj.base.array import Array

UNSEEN = 1e-9  # a direction is unseen if its image is below this, relative to rows of unit norm
SLOW = 1e-5  # |Re μ| relative to the modes' own size up to which they neither grow nor decay
_UNDECIDED = 1e-5  # modes that decay slower than this times the whole matrix are looked at


def unseen(A: Array, C: Array) -> Array:
    """Orthonormal basis of the unobservable subspace of (A, C) within the modes that do not clearly decay.

    Args:
        A: balanced, shape (N, N).
        C: any rows, shape (c, N).

    Returns:
        shape (N, r); it is A-invariant, and C vanishes on it.
    """
    size = float(np.linalg.norm(A)) or 1.0
    decay = -np.linalg.eigvals(A).real if A.size else np.zeros(0)
    looked_at = decay <= _UNDECIDED * size
    # the line is drawn in the middle of the gap, where rounding moves no eigenvalue across it
    line = (decay[looked_at].max(initial=-size) + decay[~looked_at].min(initial=2 * size)) / 2
    try:
        V = spanned(A, lambda mu: -mu.real <= line)
    except np.linalg.LinAlgError:
        V = np.eye(len(A))  # the gap is too narrow: all modes are looked at
    return _within(A, V, C)


def _within(A: Array, V: Array, C: Array) -> Array:
    """The largest invariant subspace within the invariant subspace V on which C vanishes."""
    if not V.shape[1]:
        return V
    A_V, rows = V.T @ A @ V, _unit_rows(C) @ V
    A_V = A_V / (np.linalg.norm(A) or 1.0)
    N = _null(rows)
    while N.shape[1]:
        # A N must lie in N again: what of it sticks out has to vanish
        kept = _null(A_V @ N - N @ (N.T @ A_V @ N))
        if kept.shape[1] == N.shape[1]:
            break
        N = N @ kept
    return V @ N


def spanned(A: Array, wanted: Callable[[complex], bool]) -> Array:
    """Orthonormal basis of the invariant subspace of the eigenvalues that are ``wanted``, shape (N, r)."""
    from scipy.linalg import schur

    if not A.size or not any(wanted(complex(mu)) for mu in np.linalg.eigvals(A)):
        return np.zeros((len(A), 0))
    _, Z, count = schur(A, output="real", sort=lambda re, im=0.0: wanted(complex(re, im)))
    return np.asarray(Z[:, :count])


def neutral(A: Array, C: Array) -> Array:
    """Orthonormal basis of what (A, C) does not see and what neither grows nor decays, shape (N, r)."""
    return lasting(A, unseen(A, C))


def lasting(A: Array, V: Array) -> Array:
    """The part of the invariant subspace V whose modes neither grow nor decay, shape (N, r)."""
    A_V = V.T @ A @ V
    tolerance = slow(A_V, A)
    return V @ spanned(A_V, lambda mu: abs(mu.real) <= tolerance)


def growing(A: Array, V: Array, C: Array) -> Array:
    """The part of the invariant subspace V that C does not see either, and whose modes grow, shape (N, r)."""
    N = _within(A, V, C)
    A_N = N.T @ A @ N
    tolerance = slow(A_N, A)
    return N @ spanned(A_N, lambda mu: mu.real > tolerance)


def slow(A_N: Array, A: Array) -> float:
    """|Re μ| [1/s] up to which a mode of the block ``A_N`` of ``A`` counts as neither growing nor decaying."""
    return SLOW * float(np.linalg.norm(A_N)) + 1e-10 * float(np.linalg.norm(A)) if A_N.size else 0.0


def groups(A: Array, tolerance: float) -> list[tuple[tuple[complex, ...], Array]]:
    """Eigenvalues of A that lie together (a conjugate pair does), each group with its invariant subspace.

    A defective eigenvalue comes out of rounding as several near each other; their mean is given for each.
    """
    left = [complex(mu) for mu in np.linalg.eigvals(A)] if A.size else []
    found = []
    while left:
        upper = complex(left[0].real, abs(left[0].imag))

        def near(mu: complex, upper: complex = upper) -> bool:
            return abs(complex(mu.real, abs(mu.imag)) - upper) <= 2 * tolerance

        here = [mu for mu in left if near(mu)]
        left = [mu for mu in left if not near(mu)]
        re = sum(mu.real for mu in here) / len(here)
        im = sum(abs(mu.imag) for mu in here) / len(here)
        re, im = (0.0 if abs(part) <= tolerance else part for part in (re, im))
        signs = [1.0 if mu.imag >= 0 else -1.0 for mu in here]
        found.append((tuple(complex(re, sign * im if im else 0.0) for sign in signs), spanned(A, near)))
    return found


def complement(V: Array) -> Array:
    """Orthonormal basis of what is orthogonal to the columns of V, shape (N, N − r)."""
    return np.asarray(np.linalg.qr(V, mode="complete")[0][:, V.shape[1] :])


def _null(M: Array) -> Array:
    """Orthonormal basis of the null space of M, by its singular values."""
    if not M.size:
        return np.eye(M.shape[1])
    _, values, Vh = np.linalg.svd(M)
    rank = int((values > UNSEEN).sum())
    return np.asarray(Vh[rank:].T)


def _unit_rows(C: Array) -> Array:
    norm = np.linalg.norm(C, axis=1, keepdims=True)
    return C / np.where(norm > 0, norm, 1.0)
