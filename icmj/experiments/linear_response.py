"""The frequency response of a linear closed loop: responses of plant and command to sinusoids at each signal.

Continuous control is linear, delayed or not; so is any controller that reads delayed outputs and has one mode. With a
delay t_d the observer's state is carried ahead over the delay that is assumed, by the model under the commands v that
are on their way (v acts t_d later: u = e^{−jωt_d} v):

    x_p = e^{Â t} x_o + (jω − Â)⁻¹ (I − e^{(Â − jω)t}) B̂ v,      v = −k̂ x_p

which is the limit of a clock that ticks ever faster. Intermittent control has no frequency response: what it makes of
a line depends on the others. Its continuous limit is what it is compared with.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.controller.controller import Controller, expect_intermittent
from icmj.controller.law import Law
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, Match, match_ports


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Frequency responses to S signals at F frequencies.

    Attributes:
        frequency: frequencies [Hz], shape (F,).
        signals: ``d.<input>``, added to the command; ``n.<output>``, an error of the reading; ``r.<name>``, set-point.
        x, y, u: responses of plant state, outputs and command, complex, shapes (F, n, S), (F, n_y, S), (F, n_u, S).
        applied: responses of the acting input u + d, shape (F, n_u, S).
    """

    frequency: Array
    signals: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    u: np.ndarray
    applied: np.ndarray

    def of(self, signal: str) -> int:
        """Index of a signal.

        Raises:
            AnalysisError: if there is no such signal.
        """
        if signal not in self.signals:
            raise AnalysisError(f"no signal {signal!r} acts on the loop; expected one of {', '.join(self.signals)}")
        return self.signals.index(signal)


def frequency_response(
    plant: LinearPlant, controller: Law, frequency: ArrayLike, *, match: Match = "name"
) -> FrequencyResponse:
    """The frequency response of ``plant`` under ``controller``, whose trigger is replaced by continuous control.

    Args:
        plant: the actual plant.
        controller: a :class:`icmj.Controller`, or another one of a single mode without events.
        frequency: frequencies [Hz], positive, shape (F,).
        match: how inputs and outputs of the plant are assigned to those of the controller's model.

    Raises:
        AnalysisError: if they do not correspond, a frequency is not positive, or the controller is not linear.
    """
    f = np.atleast_1d(np.asarray(frequency, dtype=float))
    if f.ndim != 1 or not (np.isfinite(f).all() and (f > 0).all()):
        raise AnalysisError("frequencies must be positive and finite, as a vector [Hz]")
    plant = match_ports(plant, controller.plant, match)
    observed = controller.observed
    law = _respond_observed(expect_intermittent(controller), f) if observed else _respond_delayed(controller, f)
    s, n, n_u, n_y = 2j * np.pi * f[:, None, None], plant.n, plant.n_u, plant.n_y
    # u = T (C x + n) + Q r, and x = (s − A)⁻¹ B (u + d)
    T, Q = law
    R = Q.shape[2]
    D = np.concatenate([np.eye(n_u), np.zeros((n_u, n_y + R))], axis=1)
    own = np.concatenate([np.zeros((len(f), n_u, n_u)), T, Q], axis=2)
    x = np.linalg.solve(s * np.eye(n) - plant.A - plant.B @ T @ plant.C, plant.B @ (own + D))
    u = T @ (plant.C @ x) + own
    names = controller.setpoint.names if controller.setpoint and R else ()
    signals = (
        *(f"d.{name}" for name in plant.inputs or map(str, range(n_u))),
        *(f"n.{name}" for name in plant.outputs or map(str, range(n_y))),
        *(f"r.{name}" for name in names),
    )
    return FrequencyResponse(f, signals, x, plant.C @ x, u, u + D)


def _respond_observed(controller: Controller, f: Array) -> tuple[np.ndarray, np.ndarray]:
    """Response of the command to readings and set-point, shapes (F, n_u, n_y) and (F, n_u, R)."""
    from scipy.linalg import expm

    design, delay = controller.model[0], controller.delay
    A, B, C, k, L = design.plant.A, design.plant.B, design.plant.C, design.k, design.L
    n, R = len(A), len(A) - controller.plant.n
    s, eye = 2j * np.pi * f[:, None, None], np.eye(n)
    late = np.exp(-s * delay.t_d)
    ahead = expm(A * delay.predicted)
    carried = np.linalg.solve(s * eye - A, (eye - ahead * np.exp(-s * delay.predicted)) @ B)
    # v = −k (ahead x_o + carried v), u = late v
    to_v = np.linalg.solve(np.eye(len(k)) + k @ carried, -k @ ahead)
    # the observer knows u: s x_o = (A − L C) x_o + B u + L y + s r in the last entries
    own = s * eye - (A - L @ C) - B @ (late * to_v)
    moved = np.concatenate([np.zeros((n - R, R)), np.eye(R)])
    return late * to_v @ np.linalg.solve(own, L + 0j * s), late * to_v @ np.linalg.solve(own, s * moved)


def _respond_delayed(controller: Law, f: Array) -> tuple[np.ndarray, np.ndarray]:
    """The same for any controller without events, in its one mode."""
    real = controller.realisation
    if len(real.modes) != 1 or real.resets or real.commands:
        raise AnalysisError(
            f"the {controller.kind} controller is not linear, or reads its own commands; a frequency response is of "
            "one mode without events and resets"
        )
    on, n_y = real.modes[0], controller.plant.n_y
    s = 2j * np.pi * f[:, None, None]
    v = np.concatenate([np.exp(-s * tau) * np.eye(n_y) for tau in real.taps], axis=1)
    inner = np.linalg.solve(s * np.eye(len(on.M)) - on.M, on.N @ v) if len(on.M) else np.zeros((len(f), 0, n_y))
    return -on.K @ inner - on.S @ v, np.zeros((len(f), controller.plant.n_u, 0), complex)
