"""The loop of a plant under the continuous predictor controller: roots, frequency response, variance.

In the controller's own time, t_d later, with P what it predicts for now (:mod:`icmj.controller.predictor`),

    ẋ   = A x + B (u + d)
    ẋ_o = Â x_o + B̂ u(t − t_d) + L (y(t − t_d) + n(t − t_d) − Ĉ x_o)
    u   = −k̂ P,      P = e^{Â t̂} x_o + ∫_0^{t̂} e^{Âθ} B̂ u(t − θ) dθ

The integral is Φ(s) u in Laplace's terms, with Φ(s) = ∫_0^{t̂} e^{(Â − sI)θ} dθ B̂, which is an entire function: it has
no poles at the eigenvalues of Â, as the differential equation for P has. Those are left out by taking it as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.controller.predictor import PredictorController
from icmj.errors import expect
from icmj.plant.linear_plant import LinearPlant, match_ports
from icmj.theory.delay_roots import DelayLoop


@dataclass(frozen=True, eq=False)
class PredictorLoop(DelayLoop):
    """The loop of a plant under the continuous predictor controller.

    F, G and tau are those of its differential equations, which have the roots of Â in addition to those of the loop.

    Attributes:
        plant: the actual plant, with inputs and outputs in the order of those of the controller.
        law: the controller.
    """

    plant: LinearPlant
    law: PredictorController

    @property
    def left_out(self) -> np.ndarray:
        """The eigenvalues of Â, if the prediction is part of the equations."""
        added = len(self.F) > self.plant.n + self.law.plant.n
        return np.linalg.eigvals(self.law.plant.A) if added else np.zeros(0)

    def characteristic(self, s: complex) -> np.ndarray:
        """The characteristic matrix Δ(s) of (x, x_o, u), shape (N, N)."""
        P, D, k = self.plant, self.law.design, self.law.design.k
        n, m, u = P.n, D.plant.n, P.n + D.plant.n
        late, N = np.exp(-s * self.law.delay.t_d), u + len(k)
        delta = np.zeros((N, N), complex)
        delta[:n, :n], delta[n:u, n:u], delta[u:, u:] = s * np.eye(n) - P.A, s * np.eye(m) - D.A_o, np.eye(len(k))
        delta[:n, u:], delta[n:u, :n], delta[n:u, u:] = -P.B, -late * D.L @ P.C, -late * D.plant.B
        delta[u:, n:u] = k @ self.law.E
        delta[u:, u:] += k @ self._integral(s)[0]
        return delta

    def slope(self, s: complex) -> np.ndarray:
        """Its derivative Δ'(s), shape (N, N)."""
        P, D, k, t_d = self.plant, self.law.design, self.law.design.k, self.law.delay.t_d
        n, u = P.n, P.n + D.plant.n
        late, slope = t_d * np.exp(-s * t_d), np.zeros((u + len(k),) * 2, complex)
        slope[:u, :u] = np.eye(u)
        slope[n:u, :n], slope[n:u, u:] = late * D.L @ P.C, late * D.plant.B
        slope[u:, u:] = k @ self._integral(s)[1]
        return slope

    def response(self, omega: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The frequency responses of (x, u) to d, n and r.

        Args:
            omega: angular frequencies ω [rad/s], shape (K,).

        Returns:
            Responses to disturbances of the inputs, to errors of the readings, and to the set-point, of shapes
            (K, n + n_u, n_u), (K, n + n_u, n_y) and (K, n + n_u, R).
        """
        P, D, r = self.plant, self.law.design, self.law.setpoint
        n, u, n_y = P.n, P.n + D.plant.n, P.n_y
        R, columns = (len(r.names) if r else 0), P.n_u + P.n_y
        found = []
        for w in np.atleast_1d(np.asarray(omega, dtype=float)):
            late, given = np.exp(-1j * w * self.law.delay.t_d), np.zeros((u + P.n_u, columns + R), complex)
            given[:n, : P.n_u], given[n:u, P.n_u : columns] = P.B, late * D.L
            if r:
                # its integral takes in what the set-point has commanded, too, which the first row of u does
                given[u:, columns:] = late * r.gain(D.k)
            found.append(np.delete(np.linalg.solve(self.characteristic(1j * w), given), np.s_[n:u], axis=0))
        d, e, s = np.split(np.array(found), [P.n_u, P.n_u + n_y], axis=2)
        return d, e, s

    def _integral(self, s: complex) -> tuple[np.ndarray, np.ndarray]:
        """Φ(s) and Φ'(s), of exponentials of blocks (Van Loan 1978)."""
        from scipy.linalg import expm

        A, B, t = self.law.plant.A, self.law.plant.B, self.law.delay.predicted
        n, n_u = B.shape
        block = np.zeros((n + 2 * n_u,) * 2, complex)
        block[:n, :n], block[:n, n : n + n_u], block[n : n + n_u, n + n_u :] = A - s * np.eye(n), B, np.eye(n_u)
        whole = expm(block * t)[:n]
        once, twice = whole[:, n : n + n_u], whole[:, n + n_u :]
        return once, twice - t * once


def predictor_loop(plant: LinearPlant, law: PredictorController) -> PredictorLoop:
    """The loop of ``plant`` under the continuous predictor controller; inputs and outputs are matched by name.

    :func:`icmj.theory.rightmost_roots` computes its characteristic roots. With an exact model these are exactly the
    eigenvalues of Â − B̂k̂ and Â − LĈ, for any delay.
    """
    expect(law, PredictorController, "the loop of a predictor")
    plant = match_ports(plant, law.plant)
    D, t_d, assumed, k = law.design, law.delay.t_d, law.delay.predicted, law.design.k
    n, m, E, B = plant.n, law.plant.n, law.E, law.plant.B
    layout, (o, p) = law.realisation.layout, (slice(n, n + m), slice(n + m, n + 2 * m))
    if "p" not in layout.names:
        F, G = np.zeros((n + m, n + m)), np.zeros((1, n + m, n + m))
        F[:n, :n], F[:n, o], F[o, o] = plant.A, -plant.B @ k, D.A_o
        G[0, o, :n], G[0, o, o] = D.L @ plant.C, -B @ k
        return PredictorLoop(F, G, np.array([t_d]), plant, law)
    F, G = np.zeros((n + 2 * m, n + 2 * m)), np.zeros((2, n + 2 * m, n + 2 * m))
    F[:n, :n], F[:n, p], F[o, o], F[p, o], F[p, p] = plant.A, -plant.B @ k, D.A_o, -E @ D.L @ law.plant.C, D.A_c
    G[0, o, :n], G[0, o, p], G[0, p, :n], G[0, p, p] = D.L @ plant.C, -B @ k, E @ D.L @ plant.C, -E @ B @ k
    G[1, p, p] = E @ B @ k
    if len(law.realisation.taps) == 1:
        return PredictorLoop(F, G[:1] + G[1:], np.array([t_d]), plant, law)
    return PredictorLoop(F, G, np.array([t_d, assumed]), plant, law)
