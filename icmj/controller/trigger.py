"""Triggers, which decide when the controller takes new feedback: event rules, clocks, and continuous control.

Every event rule says that an event is due when the hold error e_hp = x_h − x_o leaves a region about zero whose
boundary consists of *faces* |R_j e| = 1. So the event function is

    E(e) = unit · max_j E_j,      E_j(e) = |R_j e|² − 1

The paper's rule (eq. ED_e) is one face with RᵀR = Q_t/q_t² and unit q_t². Where several faces meet, E has a kink: what
needs derivatives asks for the active face, the one whose E_j is largest. All faces are even in e, because the loop is
odd: the mirror image of a motion is a motion.

The paper's event rule: a quadratic form of the hold error against a threshold (eqs. ED_e, ed_e).

The box rule: an event when any single component of the hold error passes its own threshold.

An event rule from user code as a log stores it: its numbers and its origin.

Each rule is a class here: a frozen dataclass that inherits from :class:`EventRule` and defines its faces. A rule with
memory is no trigger, but a law whose realisation has modes (:class:`icmj.controller.realisation.Realisation`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import SEMIDEFINITE, Array, balanced_modes, real
from icmj.errors import AnalysisError
from icmj.work.own_code import Fact, digest_of, plain, reference_of

if TYPE_CHECKING:
    from icmj.controller.design import Design

_NO_WEIGHT = 8 * np.finfo(float).eps  # times the states: an eigenvalue of a balanced weight that is rounding
Kind = Literal["event", "clock", "continuous", "switching"]


class Trigger(ABC):
    """The interface of every trigger; simulators and theory use this interface and never test the class.

    Attributes:
        kind: ``event``, ``clock`` or ``continuous``.
        holds: whether a hold drives the control between events; false for continuous control.
        delta_min: shortest open-loop interval Δ_min [s]; 0 if there is no such limit.
        clock: interval of a clock [s]; infinite for others.
    """

    kind: ClassVar[Kind]
    holds: ClassVar[bool] = True
    delta_min: float = 0.0

    @property
    def clock(self) -> float:
        """Interval of the clock [s]; infinite without a clock."""
        return float("inf")

    @abstractmethod
    def faces(self, design: Design) -> Faces:
        """The event function, for a controller of this design.

        Raises:
            AnalysisError: if the rule does not fit the design.
        """

    @abstractmethod
    def facts(self) -> Mapping[str, Any]:
        """The settings of the rule by their usual names, for tables and summaries."""


class EventRule(Trigger):
    """A trigger that causes an event when the hold error reaches a threshold: E(e_hp) = 0.

    Attributes:
        size: the threshold as one number; amplitudes are proportional to it, intervals do not depend on it.
    """

    kind = "event"

    @property
    @abstractmethod
    def size(self) -> float:
        """The threshold as one number."""

    @abstractmethod
    def resized(self, size: float) -> EventRule:
        """The same rule with its threshold scaled so that :attr:`size` is ``size``."""


@dataclass(frozen=True)
class ClockTrigger(Trigger):
    """A trigger that causes an event every ``interval`` seconds, as in panel (a) of the paper."""

    interval: float
    kind = "clock"

    def __post_init__(self) -> None:
        if not (np.isfinite(self.interval) and self.interval > 0):
            raise AnalysisError(f"clock interval must be positive, got {self.interval}")

    @property
    def clock(self) -> float:
        return self.interval

    def faces(self, design: Design) -> Faces:
        return no_faces(design.plant.n)

    def facts(self) -> Mapping[str, Any]:
        return {"clock": self.interval}


@dataclass(frozen=True)
class Continuous(Trigger):
    """The trigger of continuous control, which has no hold: u = −k̂ x_o (eq. u)."""

    kind = "continuous"
    holds = False

    def faces(self, design: Design) -> Faces:
        return no_faces(design.plant.n)

    def facts(self) -> Mapping[str, Any]:
        return {}


def check_delta_min(delta_min: float) -> float:
    """Check and return Δ_min.

    Raises:
        AnalysisError: if it is negative or not finite.
    """
    if not (np.isfinite(delta_min) and delta_min >= 0):
        raise AnalysisError(f"delta_min must be at least 0 s, got {delta_min}")
    return float(delta_min)


def expect_rule(trigger: object) -> None:
    """Check that ``trigger`` is an event rule.

    Raises:
        AnalysisError: if it is not.
    """
    if not isinstance(trigger, EventRule):
        raise AnalysisError(f"the rule is a {type(trigger).__name__}; expected an event rule, such as EventTrigger")


def expect_own_rule(rule: object, design: Design) -> EventRule:
    """See that an event rule of the user's own fits a controller of this design; all that is asked is asked once.

    Raises:
        AnalysisError: if it is no event rule, or does not fit.
    """
    expect_rule(rule)
    assert isinstance(rule, EventRule)
    asked = {"faces": (rule.faces(design), Faces), "facts()": (rule.facts(), Mapping), "size": (rule.size, Real),
             "delta_min": (rule.delta_min, Real), "resized(size)": (rule.resized(rule.size), EventRule)}  # fmt: skip
    for name, (found, kind) in asked.items():
        if not isinstance(found, kind):
            raise AnalysisError(f"its {name} is a {type(found).__name__}; expected a {kind.__name__}")
    R = rule.faces(design).R
    if R.ndim != 2 or R.shape[1] != design.plant.n or not np.isfinite(R).all():
        raise AnalysisError(f"the R of its faces has shape {R.shape}; expected {design.plant.n} finite columns")
    return rule


@dataclass(frozen=True, eq=False)
class Faces:
    """The F faces of an event rule; F is 0 if there is no event function.

    Attributes:
        R: the rows of all R_j, one below the other, shape (r, n̂).
        cuts: R_j consists of the rows cuts[j] … cuts[j + 1] − 1; increasing from 0 to r, shape (F + 1,), integer.
        unit: factor of E, E = unit · max_j E_j; positive.
    """

    R: Array
    cuts: np.ndarray
    unit: float = 1.0

    def __len__(self) -> int:
        return len(self.cuts) - 1

    def squares(self, components: Array) -> Array:
        """|R_j e|² from the components R e, shape (..., r) → (..., F)."""
        return np.add.reduceat(components**2, self.cuts[:-1], axis=-1)

    def levels(self, e: Array) -> Array:
        """E_j(e) of every face, shape (..., n̂) → (..., F)."""
        return self.squares(e @ self.R.T) - 1

    def E(self, e: Array) -> Array:
        """The event function, shape (..., n̂) → (...); NaN if there is no face."""
        if not len(self):
            return np.full(e.shape[:-1], np.nan)
        return np.asarray(self.unit * self.levels(e).max(axis=-1))

    def rates(self, e: Array, e_rate: Array) -> Array:
        """dE_j/dt of every face if e changes at the rate ``e_rate``; shapes (..., n̂), (..., n̂) → (..., F)."""
        return 2 * np.add.reduceat((e @ self.R.T) * (e_rate @ self.R.T), self.cuts[:-1], axis=-1)

    def active(self, e: Array) -> int:
        """The face whose E_j is largest at e, shape (n̂,)."""
        return int(np.argmax(self.levels(e)))

    def rows(self, face: int) -> slice:
        """The rows of R_j in R."""
        return slice(int(self.cuts[face]), int(self.cuts[face + 1]))

    def gradient(self, e: Array) -> Array:
        """dE/de on the active face, shape (n̂,) → (n̂,)."""
        R = self.R[self.rows(self.active(e))]
        return np.asarray(2 * self.unit * (R @ e) @ R)

    def polynomials(self, components: Array) -> Array:
        """The polynomials E_j(s) along a motion whose components R e(s) are polynomials in s; they are exact.

        Args:
            components: power coefficients of R e, by increasing power, shape (d + 1, ..., r).

        Returns:
            Power coefficients of every E_j, shape (2d + 1, ..., F).
        """
        d, shape = len(components) - 1, components.shape[1:-1]
        levels = np.zeros((2 * d + 1, *shape, len(self)))
        for i in range(d + 1):
            products = components[i] * components
            levels[i : i + d + 1] += np.add.reduceat(products, self.cuts[:-1], axis=-1)
        levels[0] -= 1
        return levels


def no_faces(n_hat: int) -> Faces:
    """No event function at all."""
    return Faces(np.zeros((0, n_hat)), np.zeros(1, dtype=int))


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
        if balanced_modes(Q)[1][0] < -SEMIDEFINITE:
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
        scales, values, vectors = balanced_modes(self.Q_t)
        kept = values > _NO_WEIGHT * len(values) * values[-1]
        root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T * scales
        return Faces(root / self.q_t, np.array([0, len(root)]), self.q_t**2)

    def facts(self) -> Mapping[str, Any]:
        return {"q_t": self.q_t, "Q_t": self.Q_t, "delta_min": self.delta_min}


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
    Q = real(weight, "Q_t", AnalysisError)
    if Q.shape not in ((n_hat,), (n_hat, n_hat)):
        raise AnalysisError(f"Q_t has shape {Q.shape}; the assumed plant has {n_hat} states")
    if Q.ndim == 2 and np.abs(Q - Q.T).max() > 1e-9 * np.abs(Q).max():
        raise AnalysisError("Q_t is not symmetric; write each entry off the diagonal twice")
    return np.diag(Q) if Q.ndim == 1 else Q


@dataclass(frozen=True, eq=False)
class BoxTrigger(EventRule):
    """The rule of an event when |e_i| > threshold_i for any i, for output errors e = Ĉe_hp or state errors e = e_hp.

    E = max_i (e_i²/threshold_i²) − 1, without a unit. Every component is a face of its own. This rule is therefore
    suitable if outputs have different units or different precision.

    Attributes:
        threshold: one for each output or state [its unit], shape (n_y,) or (n̂,); or one number for all.
        on: ``output`` or ``state``.
        delta_min: shortest open-loop interval Δ_min [s]; no event occurs earlier than this after the previous one.

    Raises:
        AnalysisError: on construction, if a threshold is not positive or Δ_min negative.
    """

    threshold: Array
    on: Literal["output", "state"] = "output"
    delta_min: float = 1e-3

    def __post_init__(self) -> None:
        threshold = np.array(self.threshold, dtype=float)
        if threshold.ndim > 1 or not threshold.size or not (np.isfinite(threshold).all() and (threshold > 0).all()):
            raise AnalysisError(f"box thresholds must be positive, one for each {self.on}; got {threshold.tolist()}")
        if self.on not in ("output", "state"):
            raise AnalysisError(f"a box is on the 'output' or the 'state' errors, not on {self.on!r}")
        check_delta_min(self.delta_min)
        object.__setattr__(self, "threshold", threshold)

    @property
    def size(self) -> float:
        """The largest threshold."""
        return float(self.threshold.max())

    def resized(self, size: float) -> BoxTrigger:
        return replace(self, threshold=self.threshold * (size / self.size))

    def faces(self, design: Design) -> Faces:
        rows = design.plant.C if self.on == "output" else np.eye(design.plant.n)
        if self.threshold.ndim and len(self.threshold) != len(rows):
            raise AnalysisError(f"the box has {len(self.threshold)} thresholds for {len(rows)} {self.on}s")
        R = rows / np.broadcast_to(self.threshold, (len(rows),))[:, None]
        return Faces(R, np.arange(len(R) + 1))

    def facts(self) -> Mapping[str, Any]:
        return {"threshold": self.threshold, "on": self.on, "delta_min": self.delta_min}


@dataclass(frozen=True, eq=False)
class RecordedRule(EventRule):
    """The faces of a rule, without its code.

    Attributes:
        R, cuts, unit: its faces for the design that it had; see :class:`icmj.controller.trigger.Faces`.
        threshold: its size.
        delta_min: shortest open-loop interval Δ_min [s].
        reference: ``module:name`` of its class.
        sha256: digest of the source file; "" if there was none.
        parameters: parameters of the rule, by name: the fields of its dataclass.
        told: the settings that the rule reported, by their usual names.
    """

    R: Array
    cuts: Array
    unit: float
    threshold: float
    delta_min: float = 0.0
    reference: str = ""
    sha256: str = ""
    parameters: Mapping[str, Fact] = field(default_factory=dict)
    told: Mapping[str, Fact] = field(default_factory=dict)

    @property
    def size(self) -> float:
        return self.threshold

    def resized(self, size: float) -> RecordedRule:
        ratio = size / self.threshold
        # the unit of E is 1, or that of the threshold squared
        return replace(self, R=self.R / ratio, unit=self.unit * (1.0 if self.unit == 1 else ratio**2), threshold=size)

    def faces(self, design: Design) -> Faces:
        return Faces(self.R, self.cuts.astype(int), self.unit)

    def facts(self) -> Mapping[str, Any]:
        return {"rule": self.reference, **self.told, "delta_min": self.delta_min}


def record_trigger(rule: Trigger, design: Design) -> Trigger:
    """A trigger as a log keeps it: itself, but for a rule that is not of icmj."""
    if not isinstance(rule, EventRule) or type(rule).__module__.startswith(f"{__package__}."):
        return rule
    faces = rule.faces(design)
    parameters: dict[str, Any] = {f.name: getattr(rule, f.name) for f in fields(rule)} if is_dataclass(rule) else {}
    return RecordedRule(
        faces.R,
        np.asarray(faces.cuts),
        float(faces.unit),
        float(rule.size),
        float(rule.delta_min),
        reference_of(rule),
        digest_of(rule),
        {name: plain(value) for name, value in parameters.items()},
        {name: plain(value) for name, value in rule.facts().items() if name != "delta_min"},
    )


TRIGGERS: tuple[type[Trigger], ...] = (EventTrigger, BoxTrigger, ClockTrigger, Continuous, RecordedRule)
"""Every kind of trigger, as logs and command line know them."""


__all__ = [
    "TRIGGERS",
    "BoxTrigger",
    "ClockTrigger",
    "Continuous",
    "EventRule",
    "EventTrigger",
    "Faces",
    "RecordedRule",
    "Trigger",
    "as_weight",
    "expect_rule",
    "output_weight",
    "record_trigger",
]
