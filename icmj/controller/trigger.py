"""Triggers, which decide when the controller takes new feedback: event rules, clocks, and continuous control.

An event is due when the hold error e_hp = x_h − x_o leaves a region about zero whose boundary consists of *faces*
|R_j e| = 1, so that the event function is E(e) = unit · max_j E_j, E_j(e) = |R_j e|² − 1. Where faces meet, E has a
kink: what needs derivatives asks for the active face, the one whose E_j is largest. All faces are even in e, because
the loop is odd. Each event rule is a file of :mod:`icmj.controller.rules`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from icmj.base.array import Array
from icmj.base.catalogue import find_moved
from icmj.errors import AnalysisError
from icmj.work.own_code import Fact, digest_of, plain, reference_of

if TYPE_CHECKING:
    from icmj.controller.design import Design

Kind = Literal["event", "clock", "continuous"]
_MOVED = {
    "EventTrigger": "icmj.controller.rules.quadratic",
    "BoxTrigger": "icmj.controller.rules.box",
    "as_weight": "icmj.controller.rules.quadratic",
    "output_weight": "icmj.controller.design",
}  # where to


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
        return make_no_faces(design.plant.n)

    def facts(self) -> Mapping[str, Any]:
        return {"clock": self.interval}


@dataclass(frozen=True)
class Continuous(Trigger):
    """The trigger of continuous control, which has no hold: u = −k̂ x_o (eq. u)."""

    kind = "continuous"
    holds = False

    def faces(self, design: Design) -> Faces:
        return make_no_faces(design.plant.n)

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


def make_no_faces(n_hat: int) -> Faces:
    """No event function at all."""
    return Faces(np.zeros((0, n_hat)), np.zeros(1, dtype=int))


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
    if not isinstance(rule, EventRule) or type(rule).__module__.startswith("icmj."):
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


def __getattr__(name: str) -> object:
    """A rule by its former place, with a warning; each is on the shelf :mod:`icmj.controller.rules`, and in icmj."""
    return find_moved(__name__, name, _MOVED)
