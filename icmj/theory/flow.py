"""The flow e^{Ā_C t} for many t at once, and functions along it as polynomials in time.

Everything rests on the increment F(t) = e^{Ā_C t} − I: it is small where t is, so nothing cancels as t → 0, and
F(s + t) = F(s) + F(t) + F(s)F(t). Short times come from the Taylor series, long ones from doubling, which is
scaling and squaring with all times of a grid sharing the work. Ā_C is balanced first (a diagonal similarity by
powers of two, exact), because gains make its rows differ by orders of magnitude.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.balancing import balance
from icmj.errors import AnalysisError

_TERMS = 18  # 1/19! = 8e-18: the Taylor series to rounding for ‖Ā_C t‖ ≤ 1
# With ‖Ā_C‖t beyond this the rounding of e^{Ā_C t} may reach 1e-6, and no eigenvalue can be placed on the circle
_STIFFEST = 1e-6 / np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class Flow:
    """The flow X̄' = Ā_C X̄, prepared by :func:`make_flow`.

    Attributes:
        A_C: Ā_C, shape (N, N).
        balanced: S⁻¹ Ā_C S, shape (N, N).
        scale: diagonal of S, shape (N,).
        series: (S⁻¹ Ā_C S u)^k / k! for k = 1 … 18, shape (18, N, N).
        unit: u, the power of two next to ``reach``, so that no unit of time makes the powers overflow [s].
        reach: largest t of one Taylor series [s], where ‖S⁻¹ Ā_C S‖ t = 1.
    """

    A_C: Array
    balanced: Array
    scale: Array
    series: Array
    unit: float
    reach: float

    def increment(self, t: ArrayLike) -> Array:
        """F(t) = e^{Ā_C t} − I for each t ≥ 0, shape (..., N, N)."""
        t = np.asarray(t, dtype=float)
        flat = t.reshape(-1)
        doublings = self.count_doublings(flat.max(initial=0.0))
        F = self._short(flat / 2**doublings)
        for _ in range(doublings):
            F = 2 * F + F @ F
        return np.asarray(F * self.scale[:, None] / self.scale).reshape(*t.shape, *self.A_C.shape)

    def exponential(self, t: ArrayLike) -> Array:
        """e^{Ā_C t} for each t ≥ 0, shape (..., N, N)."""
        return self.increment(t) + np.eye(len(self.A_C))

    def trajectory(self, X: Array, end: float, points: int) -> tuple[Array, Array]:
        """e^{Ā_C t} X on a uniform grid of at least ``points`` + 1 times from 0 to ``end``.

        Args:
            X: a state, shape (N,), or several as columns, shape (N, c).
            end: last time [s].
            points: how many steps at least; the next power of two is taken.

        Returns:
            times, shape (M,), and states, shape (M, N) or (M, N, c).
        """
        levels = max(int(np.ceil(np.log2(max(points, 2)))), 1)
        states = X.reshape(1, len(X), -1)
        F = self.increment(end / 2**levels)
        for _ in range(levels):
            states = np.concatenate([states, states + F @ states])
            F = 2 * F + F @ F
        states = np.concatenate([states, states[:1] + F @ states[:1]])
        return np.linspace(0.0, end, 2**levels + 1), states.reshape(len(states), *X.shape)

    def polynomials(self, states: Array, h: float) -> Array:
        """Taylor coefficients of e^{Ā_C h s} X̄ in s ∈ [0, 1] from each state.

        Args:
            states: start states, shape (M, N).
            h: length of each cell [s]; at most ``reach``.

        Returns:
            coefficients by rising power, shape (19, M, N).

        Raises:
            AnalysisError: if ``h`` is longer than one series reaches.
        """
        if h > self.reach * (1 + 1e-12):
            raise AnalysisError(f"a Taylor cell of {h:.3g} s is longer than the series reaches, {self.reach:.3g} s")
        terms = [states / self.scale]
        step = (self.balanced * h).T
        for k in range(1, _TERMS + 1):
            terms.append(terms[-1] @ step / k)
        return np.array(terms) * self.scale

    def demand(self, t: float) -> None:
        """Check that e^{Ā_C t} is not dominated by rounding.

        Raises:
            AnalysisError: if it cannot, because the fastest rate of the system is out of proportion to ``t`` [s].
        """
        if t > _STIFFEST * self.reach:
            raise AnalysisError(
                f"not analysable: the fastest rate of the error system, {1 / self.reach:.1e}/s, is out of proportion "
                f"to a range of {t:.4g} s; look for gains or rates of the wrong size, or search a shorter range"
            )

    def count_doublings(self, t: float) -> int:
        """How often a time that one series reaches has to be doubled to reach ``t`` [s]."""
        return max(0, int(np.ceil(np.log2(max(t / self.reach, 1.0)))))

    def _short(self, t: Array) -> Array:
        coefficients = (t / self.unit)[:, None] ** np.arange(1, _TERMS + 1)
        N = len(self.A_C)
        return (coefficients @ self.series.reshape(_TERMS, -1)).reshape(-1, N, N)


def make_flow(A_C: Array) -> Flow:
    """Prepare the flow of Ā_C.

    Raises:
        AnalysisError: if Ā_C is not a finite square matrix, or its norm is beyond all numbers.
    """
    A_C = np.asarray(A_C, dtype=float)
    if A_C.ndim != 2 or A_C.shape[0] != A_C.shape[1] or not np.isfinite(A_C).all():
        raise AnalysisError(f"not analysable: the matrix of a flow must be finite and square, got shape {A_C.shape}")
    balanced, scale = balance(A_C)
    norm = float(np.linalg.norm(balanced, 2)) or 1.0
    if not np.isfinite(norm):
        raise AnalysisError("not analysable: the rates of the error system are beyond all numbers; check the gains")
    unit = float(np.exp2(-np.clip(np.round(np.log2(norm)), -1000, 1000)))
    series = np.empty((_TERMS, *A_C.shape))
    power = np.eye(len(A_C))
    for k in range(_TERMS):
        power = power @ (balanced * unit) / (k + 1)
        series[k] = power
    return Flow(A_C, balanced, scale, series, unit, 1.0 / norm)
