"""The locus: eigenvalues of φ(Δ) over a range of Δ, each branch followed continuously (paper, panels (a) and (b))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.errors import AnalysisError
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, make_flow

POINTS = 256
_HALVINGS = 4
_CLEAR = 0.3  # an eigenvalue is followed safely if it moves less than this part of the way to its neighbour
_NEGLIGIBLE = 1e-3  # moves below this are not worth a finer grid


@dataclass(frozen=True, eq=False)
class Locus:
    """Eigenvalues of φ(Δ) over a range of Δ, each branch followed continuously (panels (a) and (b)).

    Attributes:
        delta: Δ [s], shape (M,).
        eigenvalues: shape (M, n + n̂).
    """

    delta: Array
    eigenvalues: NDArray[np.complex128]

    @property
    def largest(self) -> Array:
        """Largest |λ| at each Δ, shape (M,)."""
        return np.abs(self.eigenvalues).max(axis=1)


def follow_locus(system: ErrorSystem, delta_max: float, *, points: int = POINTS) -> Locus:
    """The eigenvalue branches on (t_d, ``delta_max``] at equal steps, followed on a finer grid where needed.

    Where φ grows beyond what numbers hold, the range ends before.

    Args:
        system: the error system.
        delta_max: end of the range [s].
        points: how many steps at least; the next power of two is taken.

    Raises:
        AnalysisError: if ``delta_max`` is not positive and finite, or so far off that not one step is computable.
    """
    if not (np.isfinite(delta_max) and delta_max > 0):
        raise AnalysisError(f"a locus needs a positive end, got {delta_max} s")
    t_d = system.delay.t_d
    if delta_max <= t_d:
        raise AnalysisError(f"no interval is shorter than the delay, {t_d:g} s; the locus must end beyond it")
    phi_t = make_flow(system.A_C)
    with np.errstate(over="ignore", invalid="ignore"):
        delta, states = phi_t.trajectory(system.entry, delta_max - t_d, points)
        phi = system.exit @ states[1:]
    # no further than numbers go
    beyond = np.flatnonzero(~np.isfinite(phi).all(axis=(1, 2)))
    points = int(beyond[0]) if len(beyond) else len(phi)
    if points == 0:
        raise AnalysisError(
            f"a locus up to {delta_max:g} s: φ is beyond all numbers from {delta[1]:g} s on; end it before"
        )
    delta, values = t_d + delta[1 : points + 1], np.linalg.eigvals(phi[:points]).astype(complex)
    wanted = np.ones(points, dtype=bool)
    check = np.arange(points - 1)  # steps not known to be clear yet
    for _ in range(_HALVINGS):
        unclear = check[_unclear(values[check], values[check + 1])]
        if not len(unclear):
            break
        middle = (delta[unclear] + delta[unclear + 1]) / 2
        delta = np.insert(delta, unclear + 1, middle)
        values = np.insert(values, unclear + 1, compute_spectra(system, phi_t, middle), axis=0)
        wanted = np.insert(wanted, unclear + 1, False)
        moved = unclear + np.arange(len(unclear))
        check = np.column_stack([moved, moved + 1]).reshape(-1)
    return Locus(delta[wanted], follow(delta, values)[wanted])


def compute_spectra(system: ErrorSystem, prepared: Flow, delta: Array) -> NDArray[np.complex128]:
    """Eigenvalues of φ(Δ) at each Δ, unordered, shape (M, n + n̂)."""
    phi = system.exit @ prepared.exponential(delta - system.delay.t_d) @ system.entry
    return np.linalg.eigvals(phi).astype(complex)


def follow(delta: Array, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Rows re-ordered so that each column is one branch.

    Where each eigenvalue has an unmistakable successor, that is it; elsewhere the assignment with the least total
    distance from a linear prediction. Where two branches meet (and leave the real axis), which is which afterwards
    is a convention.

    Args:
        delta: Δ, rising, shape (M,).
        values: eigenvalues in any order, shape (M, N).
    """
    order = np.arange(values.shape[1])
    ordered = values.copy()
    nearest, clear = _successors(values)
    for m in range(len(values) - 1):
        if clear[m]:
            order = nearest[m][order]
        else:
            here = ordered[m]
            ahead = here
            if m:
                ahead = here + (here - ordered[m - 1]) * ((delta[m + 1] - delta[m]) / (delta[m] - delta[m - 1]))
            order = _assign(np.abs(ahead[:, None] - values[m + 1]))
        ordered[m + 1] = values[m + 1, order]
    return ordered


def _assign(distance: Array) -> NDArray[np.intp]:
    """The column of each row, all different, with the least total distance."""
    nearest = distance.argmin(axis=1)
    if len(set(nearest.tolist())) == len(nearest):  # as each could not do better, neither could all
        return nearest
    from scipy.optimize import linear_sum_assignment

    return np.asarray(linear_sum_assignment(distance)[1])


def _successors(values: NDArray[np.complex128]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Nearest eigenvalue in the next row for each in this one, and whether all of them are unmistakable."""
    distance = np.abs(values[:-1, :, None] - values[1:, None, :])
    nearest = distance.argmin(axis=2)
    moved = distance.min(axis=2)
    onto = np.sort(nearest, axis=1)
    one_to_one = (onto == np.arange(values.shape[1])).all(axis=1)
    # two that pass through each other between two rows seem to stand still there: so the step before counts as well
    arrived = np.zeros_like(moved)
    arrived[1:] = distance[:-1].min(axis=1)
    far = np.maximum(moved, arrived) >= _CLEAR * _separation(values)[:-1]
    return nearest, one_to_one & ~far.any(axis=1)


def _unclear(before: NDArray[np.complex128], after: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Steps that a finer grid would make clearer: an eigenvalue of some size moves too far for its neighbours."""
    distance = np.abs(before[:, :, None] - after[:, None, :]).min(axis=2)
    far = (distance > _CLEAR * _separation(before)) & (distance > _NEGLIGIBLE)
    return np.asarray(far.any(axis=1))


def _separation(values: NDArray[np.complex128]) -> Array:
    """Distance of each eigenvalue to its nearest neighbour in the same row."""
    between = np.abs(values[:, :, None] - values[:, None, :])
    between += np.where(np.eye(values.shape[1], dtype=bool), np.inf, 0.0)
    return np.asarray(between.min(axis=2))
