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
# error of a matrix, relative to it, such as differences leave in it; what that may put in one place is not told apart
_ERROR = 1e-10
_UNDECIDED = 1e-5  # modes that decay slower than this times the whole matrix are looked at
_ALIKE = 1e-3  # relative distance at which the rate of a mode that grows is not one of the matrix
_GAP = 10.0  # and those that decay no more than so many times as fast as one of these, up to a thousandth of the matrix


def find_unseen(A: Array, C: Array) -> Array:
    """Orthonormal basis of the unobservable subspace of (A, C) within the modes that do not clearly decay.

    Args:
        A: balanced, shape (N, N).
        C: any rows, shape (c, N).

    Returns:
        shape (N, r); it is A-invariant, and C vanishes on it.
    """
    size = float(np.linalg.norm(A)) or 1.0
    decay = np.sort(-np.linalg.eigvals(A).real) if A.size else np.zeros(0)
    first, last = np.searchsorted(decay, [_UNDECIDED * size, 100 * _UNDECIDED * size], side="right")
    while 0 < first < last and decay[first] < _GAP * max(decay[first - 1], _UNDECIDED * size):
        first += 1
    # the line is drawn in the middle of the gap, where rounding moves no eigenvalue across it
    line = (decay[:first].max(initial=-size) + decay[first:].min(initial=2 * size)) / 2
    try:
        V = find_span(A, lambda mu: -mu.real <= line)
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


def find_span(A: Array, wanted: Callable[[complex], bool]) -> Array:
    """Orthonormal basis of the invariant subspace of the eigenvalues that are ``wanted``, shape (N, r)."""
    from scipy.linalg import schur

    if not A.size or not any(wanted(complex(mu)) for mu in np.linalg.eigvals(A)):
        return np.zeros((len(A), 0))
    _, Z, count = schur(A, output="real", sort=lambda re, im=0.0: wanted(complex(re, im)))
    return np.asarray(Z[:, :count])


def find_neutral(A: Array, C: Array) -> Array:
    """Orthonormal basis of what (A, C) does not see and what neither grows nor decays, shape (N, r)."""
    return select_lasting(A, find_unseen(A, C))


def select_lasting(A: Array, V: Array) -> Array:
    """The part of the invariant subspace V whose modes neither grow nor decay, shape (N, r)."""
    A_V, error = V.T @ A @ V, estimate_error(A)
    lasting = find_span(A_V, lambda mu: are_together(A_V, mu, 1j * mu.imag, error))
    N = V @ lasting
    A_N = N.T @ A @ N
    # what sticks out of N may be small beside the rest, which is fast, and not beside N; then it is not invariant
    if np.linalg.norm(A @ N - N @ A_N) > max(_ALIKE * float(np.linalg.norm(A_N)), error):
        return N[:, :0]
    # of several that are one an error makes a wide ring, but around their rate: one beside the axis is not zero
    rates = np.linalg.eigvals(A_N)
    middle = rates.real.sum() / max(len(rates), 1)
    return N if abs(middle) <= max(_GAP * error, np.abs(rates - middle).max(initial=0.0)) else N[:, :0]


def select_growing(A: Array, V: Array, C: Array) -> Array:
    """The part of the invariant subspace V that C does not see either, and whose modes grow, shape (N, r)."""
    N = _within(A, V, C)
    A_N, error, rates = N.T @ A @ N, estimate_error(A), np.linalg.eigvals(A)
    # where the rest is so fast that what sticks out of N is small beside it and not beside N, N has rates of its own
    if any(np.abs(rates - mu).min() > _ALIKE * abs(mu) for mu in np.linalg.eigvals(A_N) if mu.real > error):
        return N[:, :0]
    return N @ find_span(A_N, lambda mu: mu.real > 0 and not are_together(A_N, mu, 1j * mu.imag, error))


def estimate_error(A: Array) -> float:
    """The error of A that its modes have to stand [1/s]."""
    return _ERROR * float(np.linalg.norm(A))


def are_together(A: Array, a: complex, b: complex, error: float) -> bool:
    """Whether an error of A of this size, and less, may put an eigenvalue anywhere between a and b.

    So it is for a simple eigenvalue a as far as the error reaches; k that are a chain of integrators, of which rounding
    makes a ring, are together as far as its k-th root does.
    """
    between = a + (b - a) * np.linspace(0, 1, 9)
    gap = np.linalg.svd(between[:, None, None] * np.eye(len(A)) - A, compute_uv=False)[:, -1]
    return bool(gap.max() <= error)


def group_eigenvalues(A: Array, error: float) -> list[tuple[tuple[complex, ...], Array]]:
    """Eigenvalues of A that are together (a conjugate pair is), each group with its invariant subspace.

    A defective eigenvalue comes out of rounding as several near each other; their mean is given for each.
    """
    left = [complex(mu) for mu in np.linalg.eigvals(A)] if A.size else []
    found = []
    while left:
        upper = complex(left[0].real, abs(left[0].imag))

        def near(mu: complex, upper: complex = upper) -> bool:
            return are_together(A, complex(mu.real, abs(mu.imag)), upper, error)

        here = [mu for mu in left if near(mu)]
        left = [mu for mu in left if not near(mu)]
        re = sum(mu.real for mu in here) / len(here)
        im = sum(abs(mu.imag) for mu in here) / len(here)
        im = 0.0 if are_together(A, complex(re, im), re, error) else im
        re = 0.0 if are_together(A, complex(re, im), 1j * im, error) else re
        signs = [1.0 if mu.imag >= 0 else -1.0 for mu in here]
        found.append((tuple(complex(re, sign * im if im else 0.0) for sign in signs), find_span(A, near)))
    return found


def complete_basis(V: Array) -> Array:
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
