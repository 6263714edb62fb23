"""The intermittent controller as data: design, hold and trigger (paper, section 2.2).

u = −k̂ x_h; between samples x_h follows the hold, at a sample x_h := x_o. The observer runs all the time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from icmj.design import Design
from icmj.errors import AnalysisError
from icmj.linear_plant import Array


@dataclass(frozen=True, eq=False)
class Hold:
    """What the hold state does between samples: ẋ_h = A_h x_h (eq. hold).

    Attributes:
        name: for people.
        A_h: hold matrix, shape (n̂, n̂).
    """

    name: str
    A_h: Array


def system_matched(design: Design) -> Hold:
    """The system-matched hold, A_h = Â_c = Â − B̂k̂ (eq. holde)."""
    return Hold("system-matched", design.A_c)


def zero_order(design: Design) -> Hold:
    """The zero-order hold, A_h = 0: the control stays what it was at the sample."""
    return Hold("zero-order", np.zeros_like(design.A_c))


HOLDS = {"system-matched": system_matched, "zero-order": zero_order}


@dataclass(frozen=True, eq=False)
class EventTrigger:
    """Sample when E = e_hpᵀ Q_t e_hp − q_t² reaches zero, e_hp = x_h − x_o (eqs. ED_e, ed_e).

    Attributes:
        Q_t: positive semidefinite weight, shape (n̂, n̂).
        q_t: threshold [unit of the weighted state].
        delta_min: least open-loop interval Δ_min [s] (eq. PRP); no sample comes earlier than this after the last.
    """

    Q_t: Array
    q_t: float
    delta_min: float = 1e-3

    def __post_init__(self) -> None:
        Q = np.array(self.Q_t, dtype=float)
        if Q.ndim != 2 or Q.shape[0] != Q.shape[1] or not np.isfinite(Q).all():
            raise AnalysisError(f"Q_t must be a finite square matrix, got shape {Q.shape}")
        Q = (Q + Q.T) / 2
        if np.linalg.eigvalsh(Q)[0] < -1e-12 * max(np.abs(Q).max(), 1e-300):
            raise AnalysisError("Q_t must be positive semidefinite; it has a negative eigenvalue")
        if not (np.isfinite(self.q_t) and self.q_t > 0):
            raise AnalysisError(f"threshold q_t must be positive, got {self.q_t}")
        if not (np.isfinite(self.delta_min) and self.delta_min >= 0):
            raise AnalysisError(f"delta_min must be at least 0 s, got {self.delta_min}")
        object.__setattr__(self, "Q_t", Q)


@dataclass(frozen=True)
class ClockTrigger:
    """Sample every ``interval`` seconds (the clock-driven controller of the paper's panel (a))."""

    interval: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.interval) and self.interval > 0):
            raise AnalysisError(f"clock interval must be positive, got {self.interval}")


@dataclass(frozen=True)
class Continuous:
    """No hold at all: u = −k̂ x_o (eq. u), the continuous controller."""


Trigger = EventTrigger | ClockTrigger | Continuous


@dataclass(frozen=True, eq=False)
class Controller:
    """Everything that the closed loop needs besides the plant."""

    design: Design
    hold: Hold
    trigger: Trigger

    def triggered_by(self, trigger: Trigger) -> Controller:
        """The same controller with another trigger."""
        return replace(self, trigger=trigger)


def output_weight(design: Design) -> Array:
    """Q_t = ĈᵀĈ: the event error is measured at the outputs."""
    return design.plant.C.T @ design.plant.C


def as_weight(weight: str | ArrayLike, design: Design) -> Array:
    """Q_t from ``"output"`` (ĈᵀĈ), ``"identity"``, diagonal entries or a matrix.

    Raises:
        AnalysisError: if it does not fit the n̂ states.
    """
    n_hat = design.plant.n
    if isinstance(weight, str):
        if weight == "output":
            return output_weight(design)
        if weight == "identity":
            return np.eye(n_hat)
        raise AnalysisError(f"Q_t is {weight!r}; expected 'output', 'identity', diagonal entries or a matrix")
    Q = np.asarray(weight, dtype=float)
    Q = np.diag(Q) if Q.ndim == 1 else Q
    if Q.shape != (n_hat, n_hat):
        raise AnalysisError(f"Q_t has shape {Q.shape}; the assumed plant has {n_hat} states")
    return Q
