"""Pairs of steps of a set-point in random order, by which a double-step experiment looks for refractoriness."""

from __future__ import annotations

from typing import Literal

from icmj.base.array import Array, Finite, Positive
from icmj.controller.step_pairs import StepPairs, double_steps
from icmj.errors import AnalysisError
from icmj.runfile.table import keys_of, make
from icmj.runfile.target import TargetTable

MOST_STEPS = 10_000  # of pairs of steps


@keys_of(double_steps)
class DoubleStepsSetpoint(TargetTable):
    """Pairs of steps of a double-step experiment, in random order; the second step goes on, or back twice as far."""

    kind: Literal["double-steps"]
    size: Finite
    start: Positive = 1.0
    """Time before the first pair [s]."""

    def pairs(self) -> StepPairs:
        """The pairs.

        Raises:
            AnalysisError: if an interval is repeated, the size is zero, or there are too many steps.
        """
        keys = self.model_dump()
        steps = 2 * len(keys["isi"]) * len(keys["directions"]) * keys["repetitions"]
        if steps > MOST_STEPS:
            raise AnalysisError(f"a double-step set-point of {steps} steps; expected at most {MOST_STEPS}")
        return make(double_steps, self)

    @property
    def whole(self) -> float:
        return self.pairs().end

    def terms(self, end: float) -> Array:
        return self.pairs().terms


SETPOINT = DoubleStepsSetpoint
