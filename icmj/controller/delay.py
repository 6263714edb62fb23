"""The delay between an event and its action.

At an event t_i the pair (x_o, x_h) is sampled. The old hold continues until t_i + t_d; then x_h := E_p (x_o, x_h)(t_i),
a prediction over the delay that the controller *assumes* (:mod:`icmj.controller.model_prediction`), which may differ
from the actual one.

An event rule is armed again only after its feedback has acted, so at most one action is pending. A clock may tick
faster than the delay; the model is then run through the pending resets, each at the time at which the controller
expects it. The controller knows its own hold, so a reset that has taken place is no longer expected; overdue resets are
left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING
from icmj.errors import AnalysisError

LEAST = 1e-9  # s; with a shorter one event and action cannot be told apart in a recording


@dataclass(frozen=True)
class Delay:
    """The time from an event to its action.

    Attributes:
        t_d: the actual delay [s].
        assumed: the delay that the predictor assumes [s]; ``t_d`` if ``None``.

    Raises:
        AnalysisError: on construction, if a delay is negative or not finite, if only the assumed delay is positive, or
            if the actual delay is too short to be resolved.
    """

    t_d: float = 0.0
    assumed: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_d", float(self.t_d))
        object.__setattr__(self, "assumed", None if self.assumed is None else float(self.assumed))
        for name, value in (("delay", self.t_d), ("assumed delay", self.predicted)):
            if not (np.isfinite(value) and value >= 0):
                raise AnalysisError(f"the {name} must be at least 0 s and finite, got {value}")
        if 0 < self.t_d < LEAST:
            raise AnalysisError(f"the delay must be 0 or at least {LEAST:g} s, got {self.t_d:g}")
        if self.t_d == 0 and self.predicted > 0:
            raise AnalysisError(
                f"a delay of {self.predicted:g} s is assumed where none is there; give the actual one, too"
            )

    @property
    def predicted(self) -> float:
        """The delay that the predictor compensates for [s]."""
        return self.t_d if self.assumed is None else self.assumed

    def __bool__(self) -> bool:
        return self.t_d > 0

    def in_flight(self, clock: float) -> int:
        """The largest number of pending actions right after an event, under a rule or a clock of this interval."""
        if not self:
            return 0
        return max(int(np.ceil(self.t_d / clock * (1 - RELATIVE_ROUNDING))), 1) if np.isfinite(clock) else 1

    def expected(self, ages: Sequence[float]) -> list[float]:
        """Times until pending actions are expected [s], from the ages of their events; overdue ones are left out."""
        times = [self.predicted - age for age in ages]
        return [time for time in times if time > RELATIVE_ROUNDING * self.predicted]


NO_DELAY = Delay()
