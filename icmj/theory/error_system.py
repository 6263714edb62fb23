"""The error system of intermittent control with a wrong model (paper, section 3; general orders).

With T̂ (n̂ × n), x̃_o = x_o − T̂x and x̃_h = x_h − T̂x, the closed loop between samples is X̄' = Ā_C X̄ with X̄ = (x,
x̃_o, x̃_h); an event sets x̃_h := x̃_o (A_D), and φ(Δ) maps x̄ = (x, x̃_o) from event to event.

With a delay t_d the event itself resets nothing, so that φ(Δ) maps the whole of X̄ from event to event: the state flows
for t_d, then x̃_h is set to the prediction, then the state flows on. The two cases differ only in ``lift``, ``entry``
and ``exit``: the state right after an event, right after its action, and at the next event.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from icmj.base.array import Array, real
from icmj.base.balancing import compute_exponential
from icmj.controller.closed_loop import ERRORS, compose
from icmj.controller.controller import Controller
from icmj.controller.delay import NO_DELAY, Delay
from icmj.controller.design import Design
from icmj.controller.hold import Hold, system_matched
from icmj.controller.model_prediction import make_predictor
from icmj.controller.trigger import ClockTrigger
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, Match, match_ports, transformation


@dataclass(frozen=True, eq=False)
class ErrorSystem:
    """X̄' = Ā_C X̄ between events, X̄ := A_D X̄ at an event (eqs. X_c, imp_X_D).

    Attributes:
        A_C: Ā_C, shape (n + 2n̂, n + 2n̂) (eq. AC_smh_sens, generalised to n ≠ n̂ and to any hold).
        T_hat: T̂, shape (n̂, n).
        actual: the actual plant [A, B, C].
        design: gains and assumed plant [Â, B̂, Ĉ].
        hold: hold of the controller; system-matched if ``None``.
        delay: t_d and the delay that the predictor assumes.
    """

    A_C: Array
    T_hat: Array
    actual: LinearPlant
    design: Design
    hold: Hold | None = None
    delay: Delay = NO_DELAY

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

    @cached_property
    def lift(self) -> Array:
        """X̄ right after an event from the state w at the event: 𝔗̄, or the identity with a delay; shape (N, N_w)."""
        return np.eye(len(self.A_C)) if self.delay else self.T_bar

    @cached_property
    def exit(self) -> Array:
        """The state w at an event from X̄ just before it; shape (N_w, N)."""
        return np.eye(len(self.A_C)) if self.delay else self.T @ self.A_D

    @cached_property
    def entry(self) -> Array:
        """X̄ right after the action of an event from the state w at the event; shape (N, N_w)."""
        if not self.delay:
            return self.T_bar
        flown = compute_exponential(self.A_C * self.delay.t_d)
        original = self.to_original(np.eye(len(self.A_C))).T  # (x, x_o, x_h) from X̄
        E_p = make_predictor(self.design, self.hold or system_matched(self.design), self.delay.predicted)
        flown[self.n + self.n_hat :] = E_p @ original[self.n :] - self.T_hat @ flown[: self.n]
        return np.asarray(flown)

    def phi(self, delta: float) -> Array:
        """φ(Δ) of the state at events, w_{i+1} = φ(Δ_i) w_i; shape (N_w, N_w), for Δ ≥ t_d.

        Without a delay w = x̄ and φ(Δ) = 𝔗 A_D e^{Ā_C Δ} 𝔗̄ (eq. pd). With a delay w = X̄ and
        φ(Δ) = e^{Ā_C (Δ − t_d)} R.
        """
        return np.asarray(self.exit @ compute_exponential(self.A_C * (delta - self.delay.t_d)) @ self.entry)

    def start(self, w: Array) -> tuple[Array, Array, Array]:
        """(x, x_o, x_h) right after an event with the state w, shapes (n,), (n̂,), (n̂,)."""
        x, x_o, x_h = np.split(self.to_original(self.lift @ w), [self.n, self.n + self.n_hat])
        return x, x_o, x_h

    def to_original(self, X: Array) -> Array:
        """(x, x_o, x_h) from X̄ = (x, x̃_o, x̃_h); last axis is the state, shape (..., n + 2n̂)."""
        return self._count_from(X, -1)

    def from_original(self, X: Array) -> Array:
        """X̄ = (x, x̃_o, x̃_h) from (x, x_o, x_h); last axis is the state, shape (..., n + 2n̂)."""
        return self._count_from(X, 1)

    def _count_from(self, X: Array, times: int) -> Array:
        """States of observer and hold less so many ``times`` T̂x."""
        X = np.array(X, dtype=float)
        origin = times * (X[..., : self.n] @ self.T_hat.T)
        X[..., self.n : self.n + self.n_hat] -= origin
        X[..., self.n + self.n_hat :] -= origin
        return X


def error_system(
    actual: LinearPlant,
    design: Design,
    hold: Hold | None = None,
    T_hat: Array | None = None,
    delay: Delay = NO_DELAY,
    match: Match = "name",
) -> ErrorSystem:
    """Build the error system of ``actual`` under ``design``.

    Args:
        actual: the actual plant [A, B, C].
        design: gains k̂, L and the assumed plant [Â, B̂, Ĉ].
        hold: the hold; the system-matched hold if ``None``.
        T_hat: T̂, shape (n̂, n); if ``None``, states of the same name are matched. The choice changes the
            coordinates, not the closed loop.
        delay: delay between an event and its action; by default there is none.
        match: how inputs and outputs of the two plants correspond: by name, and by position for plants without names
            (:func:`icmj.plant.linear_plant.match_ports`). Those of the system are in the order of the assumed plant.

    Raises:
        AnalysisError: if inputs and outputs of the two plants differ in number or name, or hold or T̂ does not fit.
    """
    assumed = design.plant
    actual = match_ports(actual, assumed, match)
    T_hat = transformation(assumed, actual) if T_hat is None else np.atleast_2d(real(T_hat, "T̂", AnalysisError))
    if T_hat.shape != (assumed.n, actual.n):
        raise AnalysisError(f"T̂ has shape {T_hat.shape}; expected {(assumed.n, actual.n)}")
    hold = hold or system_matched(design)
    # between events neither the trigger nor the delay matters
    loop = compose(actual, Controller(design, hold, ClockTrigger(1.0)), ERRORS, T_hat)
    return ErrorSystem(loop.F, T_hat, actual, design, hold, delay)
