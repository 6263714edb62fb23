"""The exact propagation of ż = M z on a fine grid, with a polynomial for every step that is exact to round-off."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers

_STEP_NORM = 2.0  # ‖M h‖ of one step: the terms of its series stay below 2, so nothing cancels
_LONGEST_SERIES = 48
_BLOCK = 64  # steps advanced by one matrix product


class Propagator:
    """z(t + θh) = Σ_j (M h)^j/j! z(t) θ^j, θ in [0, 1], the matrix exponential's series cut below round-off.

    Attributes:
        M: generator, shape (m, m).
        h: step [s]; ‖M h‖₂ = 2 after balancing.
        degree: N of the series; its last two terms are below 1e-18 of the sum, entry by entry.
        block: steps that :meth:`states` advances at once.
    """

    def __init__(self, M: Array, longest: float = 1e3) -> None:
        from scipy.linalg import expm, matrix_balance

        self.M = np.asarray(M, dtype=float)
        m = len(self.M)
        balanced = matrix_balance(self.M, permute=False)[0]
        self.h = min(_STEP_NORM / max(float(np.linalg.norm(balanced, 2)), 1e-300), longest)
        self._generator = self.M * self.h
        series = [np.eye(m), self._generator]
        total = np.abs(series[0]) + np.abs(series[1])
        small = 0
        while small < 2 and len(series) < _LONGEST_SERIES:
            series.append(series[-1] @ self._generator / len(series))
            # entry by entry, hence in any scaling of the states
            small = small + 1 if np.all(np.abs(series[-1]) <= 1e-18 * total) else 0
            total += np.abs(series[-1])
        self.degree, self.block = len(series) - 1, _BLOCK
        self._series = np.array(series)
        powers = [np.eye(m), expm(self._generator)]
        while len(powers) <= _BLOCK:
            powers.append(powers[1] @ powers[-1])
        self._powers = np.array(powers).reshape(-1, m)

    def states(self, z: Array) -> Array:
        """z at the ends of ``block`` steps from ``z``, itself first; shape (block + 1, m)."""
        return (self._powers @ z).reshape(-1, len(z))

    def within(self, Z: Array, theta: Array) -> Array:
        """z at fractions ``theta`` (S,) of the steps that start at ``Z`` (S, m); shape (S, m)."""
        result = Z
        for j in range(self.degree, 0, -1):
            result = Z + (theta / j)[:, None] * (result @ self._generator.T)
        return result

    def powers_of(self, C: Array) -> Array:
        """Maps z at a step's start to the power coefficients of C z(θ); shape (degree + 1, rows of C, m)."""
        return C @ self._series

    def controls_of(self, C: Array) -> Array:
        """Maps z at a step's start to the Bernstein coefficients of C z(θ); shape (degree + 1, rows of C, m)."""
        return np.einsum("ij,jrm->irm", from_powers(self.degree), self.powers_of(C))
