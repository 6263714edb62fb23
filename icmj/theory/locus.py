"""Eigenvalues of φ(Δ) over a range of Δ, each branch followed continuously (panels (a) and (b) of the paper)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icmj.errors import AnalysisError
from icmj.linear_plant import Array
from icmj.theory.error_system import ErrorSystem
from icmj.theory.flow import Flow, flow
from icmj.theory.prediction import Locus

POINTS = 256


def locus(system: ErrorSystem, delta_max: float, *, points: int = POINTS, prepared: Flow | None = None) -> Locus:
    """The eigenvalue branches on (0, ``delta_max``], at least ``points`` of them.

    Raises:
        AnalysisError: if ``delta_max`` is not positive and finite.
    """
    if not (np.isfinite(delta_max) and delta_max > 0):
        raise AnalysisError(f"a locus needs a positive end, got {delta_max} s")
    phi_t = prepared or flow(system.A_C)
    delta = delta_max * np.arange(1, points + 1) / points
    values = spectra(system, phi_t, delta)
    return Locus(delta, follow(values))


def spectra(system: ErrorSystem, prepared: Flow, delta: Array) -> NDArray[np.complex128]:
    """Eigenvalues of φ(Δ) at each Δ, unordered, shape (M, n + n̂)."""
    phi = system.T @ prepared.exponential(delta) @ system.T_bar
    return np.linalg.eigvals(phi).astype(complex)


def follow(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Rows re-ordered so that each column is one branch."""
    from scipy.optimize import linear_sum_assignment

    ordered = values.copy()
    for m in range(1, len(values)):
        predicted = ordered[m - 1] if m == 1 else 2 * ordered[m - 1] - ordered[m - 2]
        _, columns = linear_sum_assignment(np.abs(predicted[:, None] - values[m]))
        ordered[m] = values[m, columns]
    return ordered
