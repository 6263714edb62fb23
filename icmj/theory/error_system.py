"""The error system of intermittent control with a wrong model (paper, section 3; general orders).

With T̂ (n̂ × n), x̃_o = x_o − T̂x and x̃_h = x_h − T̂x, the closed loop between samples is X̄' = Ā_C X̄ with
X̄ = (x, x̃_o, x̃_h); an event sets x̃_h := x̃_o (A_D), and from event to event x̄ = (x, x̃_o) goes by φ(Δ).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from icmj.base.array import Array
from icmj.controller.design import Design
from icmj.controller.hold import Hold, system_matched
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, transformation


@dataclass(frozen=True, eq=False)
class ErrorSystem:
    """X̄' = Ā_C X̄ between events, X̄ := A_D X̄ at an event (eqs. X_c, imp_X_D).

    Attributes:
        A_C: Ā_C, shape (n + 2n̂, n + 2n̂) (eq. AC_smh_sens, generalised to n ≠ n̂ and to any hold).
        T_hat: T̂, shape (n̂, n).
        actual: the actual plant [A, B, C].
        design: gains and assumed plant [Â, B̂, Ĉ].
    """

    A_C: Array
    T_hat: Array
    actual: LinearPlant
    design: Design

    @property
    def n(self) -> int:
        """Number of states of the actual plant."""
        return self.actual.n

    @property
    def n_hat(self) -> int:
        """Number of states of the assumed plant."""
        return self.design.plant.n

    @property
    def k(self) -> Array:
        """k = k̂T̂, shape (n_u, n)."""
        return self.design.k @ self.T_hat

    @property
    def A_D(self) -> Array:
        """The jump x̃_h := x̃_o (eq. AD)."""
        n, m = self.n, self.n_hat
        A_D = np.eye(n + 2 * m)
        A_D[n + m :, n + m :] = 0
        A_D[n + m :, n : n + m] = np.eye(m)
        return A_D

    @property
    def T(self) -> Array:
        """𝔗 with x̄ = 𝔗 X̄ (eq. T), shape (n + n̂, n + 2n̂)."""
        return np.eye(self.n + self.n_hat, self.n + 2 * self.n_hat)

    @property
    def T_bar(self) -> Array:
        """𝔗̄ with X̄ = 𝔗̄ x̄ after an event (eq. Tb), shape (n + 2n̂, n + n̂)."""
        n, m = self.n, self.n_hat
        return np.vstack([np.eye(n + m), np.eye(m, n + m, n)])

    @property
    def T_t(self) -> Array:
        """𝔗_t with e_hp = 𝔗_t X̄, shape (n̂, n + 2n̂)."""
        n, m = self.n, self.n_hat
        return np.hstack([np.zeros((m, n)), -np.eye(m), np.eye(m)])

    @property
    def C_y(self) -> Array:
        """y = C_y X̄, shape (n_y, n + 2n̂)."""
        return np.hstack([self.actual.C, np.zeros((self.actual.n_y, 2 * self.n_hat))])

    @property
    def C_u(self) -> Array:
        """u = −k̂ x_h = C_u X̄, shape (n_u, n + 2n̂)."""
        return np.hstack([-self.k, np.zeros((self.actual.n_u, self.n_hat)), -self.design.k])

    def phi(self, delta: float) -> Array:
        """φ(Δ) = 𝔗 A_D e^{Ā_C Δ} 𝔗̄, shape (n + n̂, n + n̂) (eq. pd); x̄_{i+1} = φ(Δ_i) x̄_i."""
        return self.T @ self.A_D @ expm(self.A_C * delta) @ self.T_bar

    def to_original(self, X: Array) -> Array:
        """(x, x_o, x_h) from X̄ = (x, x̃_o, x̃_h); last axis is the state, shape (..., n + 2n̂)."""
        X = np.array(X, dtype=float)
        shift = X[..., : self.n] @ self.T_hat.T
        X[..., self.n : self.n + self.n_hat] += shift
        X[..., self.n + self.n_hat :] += shift
        return X

    def from_original(self, X: Array) -> Array:
        """X̄ = (x, x̃_o, x̃_h) from (x, x_o, x_h); last axis is the state, shape (..., n + 2n̂)."""
        X = np.array(X, dtype=float)
        shift = X[..., : self.n] @ self.T_hat.T
        X[..., self.n : self.n + self.n_hat] -= shift
        X[..., self.n + self.n_hat :] -= shift
        return X


def error_system(
    actual: LinearPlant, design: Design, hold: Hold | None = None, T_hat: Array | None = None
) -> ErrorSystem:
    """Build the error system of ``actual`` under ``design``.

    Args:
        actual: the plant [A, B, C] that is really there.
        design: gains k̂, L and the assumed plant [Â, B̂, Ĉ].
        hold: the system-matched hold if ``None``.
        T_hat: T̂, shape (n̂, n); states of the same name are matched if ``None``. The choice changes the
            coordinates, not the closed loop.

    Raises:
        AnalysisError: if inputs and outputs of the two plants differ in number, or T̂ does not fit.
    """
    assumed = design.plant
    if (actual.n_u, actual.n_y) != (assumed.n_u, assumed.n_y):
        raise AnalysisError(
            f"the actual plant has {actual.n_u} inputs and {actual.n_y} outputs, the assumed one "
            f"{assumed.n_u} and {assumed.n_y}; they must agree"
        )
    T_hat = transformation(assumed, actual) if T_hat is None else np.atleast_2d(np.asarray(T_hat, float))
    if T_hat.shape != (assumed.n, actual.n):
        raise AnalysisError(f"T̂ has shape {T_hat.shape}; expected {(assumed.n, actual.n)}")
    A, B, C = actual.A, actual.B, actual.C
    k_hat, L = design.k, design.L
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by the analysis
        k = k_hat @ T_hat
        A_h = (hold or system_matched(design)).A_h
        A_k = A - B @ k
        B_tilde = assumed.B - T_hat @ B
        Z = np.zeros((actual.n, assumed.n))
        Z_m = np.zeros((assumed.n, assumed.n))
        A_C = np.block(
            [
                [A_k, Z, -B @ k_hat],
                [
                    assumed.A @ T_hat - T_hat @ A - B_tilde @ k - L @ (assumed.C @ T_hat - C),
                    design.A_o,
                    -B_tilde @ k_hat,
                ],
                [A_h @ T_hat - T_hat @ A_k, Z_m, A_h + T_hat @ B @ k_hat],
            ]
        )
    return ErrorSystem(A_C, T_hat, actual, design)
