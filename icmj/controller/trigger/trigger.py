"""Triggers, which decide when the controller takes new feedback: event rules, clocks, and continuous control."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from icmj.controller.trigger.faces import Faces, no_faces
from icmj.errors import AnalysisError

if TYPE_CHECKING:
    from icmj.controller.design import Design

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


def checked_delta_min(delta_min: float) -> float:
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
