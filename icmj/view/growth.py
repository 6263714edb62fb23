"""How a deviation grows from sample to sample under a clock, as the theory has it."""

from __future__ import annotations

from icmj.base.array import Array
from icmj.result.result import Result
from icmj.theory.error_system import error_system
from icmj.theory.locus import largest

POINTS = 128
BEYOND = 1.6  # times Δ_crit


def predicted_growth(result: Result) -> tuple[Array, Array]:
    """Intervals [s] and the largest |λ| of φ there, shapes (M,): from the delay to somewhat beyond Δ_crit."""
    prediction, controller = result.prediction, result.controller
    end = prediction.delta_max
    if prediction.delta_crit is not None:
        end = min(end, BEYOND * prediction.delta_crit)
    system = error_system(result.actual, controller.design, controller.hold, delay=controller.delay, match="position")
    return largest(system, end, points=POINTS)
