"""The continuous predictor controller: observer, predictor and feedback all the time, over a delay.

What is commanded now, v(t), acts t_d later: u(t) = v(t − t_d). The observer knows what acts, the predictor what is
under way (Gawthrop, Loram, Lakie and Gollee 2011):

    ẋ_o = Â x_o + B̂ u + L (y − Ĉ x_o)
    p   = e^{Â t̂} x_o + ∫_{t−t̂}^{t} e^{Â(t−s)} B̂ v(s) ds,      v = −k̂ p

with t̂ the delay that it assumes. With an exact model p(t) = x(t + t_d) but for the observer's error, and the poles are
those of Â − B̂k̂ and Â − LĈ alone, whatever the delay (Manitius and Olbrot 1979: finite spectrum assignment).

It is run as it acts, t_d later: x_o and p are those of t − t_d, whose readings and commands are taps, and the integral
is over the commands that acted in the last t̂. The equation ṗ = (Â − B̂k̂) p + … that follows from it leaves a
difference between p and the integral to itself, which grows with the plant's own modes. So p follows it for t̂ at a
time, and is then taken from the integral anew: z, with ż = Â z + B̂ u, has been 0 that long ago.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.controller.delay import Delay
from icmj.controller.design import Design
from icmj.controller.law import Law, expect_part, expect_setpoint
from icmj.controller.layout import Layout
from icmj.controller.model_prediction import expect_predictable
from icmj.controller.realisation import Mode, Realisation
from icmj.controller.setpoint import Setpoint
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant


@dataclass(frozen=True, eq=False)
class PredictorController(Law):
    """The continuous predictor controller, for a delay; without a delay, use :class:`icmj.Continuous`.

    Before t = 0 its commands are zero, and its readings are the outputs at t = 0. Its observer starts at zero, t_d
    before t = 0.

    Attributes:
        design: gains k̂ and L for the assumed plant.
        delay: the actual delay t_d and the delay that the predictor assumes.
        setpoint: the set-point r(t) that it follows. A change is known when it occurs and takes effect t_d later.
            ``None`` if r is always 0.

    Raises:
        AnalysisError: on construction, if a part has the wrong class, there is no delay, the set-point belongs to
            another model, or the model is so unstable over the assumed delay that a prediction would have no correct
            digit.
    """

    design: Design
    delay: Delay
    setpoint: Setpoint | None = None

    def __post_init__(self) -> None:
        expect_part(self.design, Design)
        expect_part(self.delay, Delay)
        if not self.delay:
            raise AnalysisError(
                "the predictor controller predicts over a delay, and there is none; give one, or take Continuous()"
            )
        expect_predictable(self.plant.A, self.delay.predicted)
        expect_setpoint(self.setpoint, self.plant)

    @property
    def plant(self) -> LinearPlant:
        """The plant of its design."""
        return self.design.plant

    kind = "predictor"

    def facts(self) -> Mapping[str, Any]:
        """The delays and the gains."""
        k, L = self.design.k, self.design.L
        return {"delay": self.delay.t_d, "assumed_delay": self.delay.predicted, "k": k, "L": L}

    @property
    def E(self) -> Array:
        """e^{Â t̂}, shape (n̂, n̂)."""
        from scipy.linalg import expm

        return np.asarray(expm(self.plant.A * self.delay.predicted))

    @cached_property
    def realisation(self) -> Realisation:
        """The realisation, with the state (x_o, p, z) and the set-point delayed by t_d."""
        design, (A, B, C), k, L = self.design, (self.plant.A, self.plant.B, self.plant.C), self.design.k, self.design.L
        t_d, assumed, r = self.delay.t_d, self.delay.predicted, self.setpoint
        n, n_u, n_y, R = len(A), B.shape[1], len(C), len(r.names) if r else 0
        same = abs(assumed - t_d) <= RELATIVE_ROUNDING * t_d
        predicts = same or assumed > RELATIVE_ROUNDING * t_d  # else p is x_o
        taps = (t_d,) if same or not predicts else tuple(sorted((assumed, t_d)))
        layout = Layout.of(x_o=n, **({"p": n, "z": n} if predicts else {}), **({"r": R} if R else {}))
        each, size = n_y + n_u, layout.size
        o, p = layout["x_o"], layout["p" if predicts else "x_o"]
        K, M, N, J = np.zeros((n_u, size)), np.zeros((size, size)), np.zeros((size, each * len(taps) + R)), np.eye(size)
        K[:, p] = k
        if r:
            K[:, layout["r"]] = -r.gain(k)
            N[layout["r"], -R:] = np.eye(R)
        then = each * taps.index(t_d)
        read, acted = slice(then, then + n_y), slice(then + n_y, then + each)
        M[o, o], N[o, read], N[o, acted] = design.A_o, L, B
        if predicts:
            z, E = layout["z"], self.E
            M[p] = -B @ K
            M[z] = M[p]
            M[p, p], M[p, o], M[z, z], N[p, read] = A + M[p, p], -E @ L @ C, A, E @ L
            if not same:  # else what leaves the integral is what the observer takes up
                gone = each * taps.index(assumed) + n_y
                N[p, acted], N[p, gone : gone + n_u] = E @ B, -E @ B
            J[p], J[z] = 0, 0
            J[p, o], J[p, z] = E, np.eye(n)
        signals = np.zeros((0, 6))
        if r:  # as long after it as the command acts
            signals = r.terms + t_d * np.array([0, 0, 0, 0, 1, 1])
            signals[:, 3] -= r.terms[:, 2] * t_d
        mode = Mode("predictor", M, N, K, np.zeros((n_u, N.shape[1])))
        return Realisation(
            layout, (mode,), J, np.eye(size), np.zeros((0, size)), np.zeros(1, dtype=int), taps=taps, commands=True,
            period=assumed if predicts else np.inf, signals=signals,
        )  # fmt: skip
