"""The paper's event rule: a quadratic form of the hold error against a threshold (eqs. ED_e, ed_e).

It is one face with RᵀR = Q_t/q_t², and the unit of E is q_t².
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import RELATIVE_ROUNDING, Array, NonNegative, Positive, Weight, real
from icmj.base.balancing import compute_balanced_modes
from icmj.controller.design import Design, output_weight
from icmj.controller.trigger import EventRule, Faces, check_delta_min
from icmj.errors import AnalysisError

_NO_WEIGHT = 8 * np.finfo(float).eps  # times the states: an eigenvalue of a balanced weight that is rounding


@dataclass(frozen=True, eq=False)
class EventTrigger(EventRule):
    """The rule of an event when E = e_hpᵀ Q_t e_hp − q_t² reaches zero, with e_hp = x_h − x_o (eqs. ED_e, ed_e).

    Attributes:
        Q_t: positive semidefinite weight, shape (n̂, n̂).
        q_t: threshold [unit of the weighted state].
        delta_min: shortest open-loop interval Δ_min [s] (eq. PRP); no event occurs earlier than this after the
            previous one.

    Raises:
        AnalysisError: if Q_t is not positive semidefinite or is zero, q_t not positive, or Δ_min negative.
    """

    Q_t: Array
    q_t: float
    delta_min: float = 1e-3

    def __post_init__(self) -> None:
        Q = real(self.Q_t, "Q_t", AnalysisError)
        if Q.ndim != 2 or Q.shape[0] != Q.shape[1] or not np.isfinite(Q).all():
            raise AnalysisError(f"Q_t must be a finite square matrix, got shape {Q.shape}")
        Q = (Q + Q.T) / 2
        # rounding of M'Q_tM is small beside Q_t, and less so beside an entry of its diagonal that nearly vanishes
        if compute_balanced_modes(Q)[1][0] < -RELATIVE_ROUNDING:
            raise AnalysisError("Q_t must be positive semidefinite; it has a negative eigenvalue")
        if not np.any(Q):
            raise AnalysisError("Q_t is zero: no hold error would ever be an event; weight at least one state")
        if not (np.isfinite(self.q_t) and self.q_t > 0):
            raise AnalysisError(f"threshold q_t must be positive, got {self.q_t}")
        check_delta_min(self.delta_min)
        object.__setattr__(self, "Q_t", Q)

    @property
    def size(self) -> float:
        return self.q_t

    def resized(self, size: float) -> EventTrigger:
        return replace(self, q_t=size)

    def faces(self, design: Design) -> Faces:
        if self.Q_t.shape != (design.plant.n, design.plant.n):
            raise AnalysisError(f"Q_t has shape {self.Q_t.shape}; the hold has {design.plant.n} states")
        scales, values, vectors = compute_balanced_modes(self.Q_t)
        kept = values > _NO_WEIGHT * len(values) * values[-1]
        root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T * scales
        return Faces(root / self.q_t, np.array([0, len(root)]), self.q_t**2)

    def facts(self) -> Mapping[str, Any]:
        return {"q_t": self.q_t, "Q_t": self.Q_t, "delta_min": self.delta_min}


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
    Q = real(weight, "Q_t", AnalysisError)
    if Q.shape not in ((n_hat,), (n_hat, n_hat)):
        raise AnalysisError(f"Q_t has shape {Q.shape}; the assumed plant has {n_hat} states")
    if Q.ndim == 2 and np.abs(Q - Q.T).max() > 1e-9 * np.abs(Q).max():
        raise AnalysisError("Q_t is not symmetric; write each entry off the diagonal twice")
    return np.diag(Q) if Q.ndim == 1 else Q


def from_keys(
    design: Design, Q_t: Weight = "output", q_t: Positive | None = None, delta_min: NonNegative = 1e-3
) -> EventTrigger:
    """The rule of a run file.

    Args:
        design: of the controller.
        Q_t: weight of the hold error in the quadratic rule, in the same forms as ``design.Q_c``.
        q_t: threshold of the quadratic rule, required for it: an event occurs when √(eᵀQ_te) = q_t [unit of the
            outputs].
        delta_min: Δ_min [s].

    Raises:
        AnalysisError: if the weight does not fit the design.
    """
    assert q_t is not None
    return EventTrigger(as_weight(Q_t, design), q_t, delta_min)


RULE = EventTrigger
