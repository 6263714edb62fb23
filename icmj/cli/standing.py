"""Whether a body stands by the linear theory, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.base.numbers import amounts

if TYPE_CHECKING:
    from icmj.theory.prediction import Prediction


def say_standing(prediction: Prediction) -> str:
    """Whether the body stands by the linear theory, and how far it then sways; in one sentence."""
    if prediction.cycle and not prediction.observer_feedback_stable:
        return "By the linear theory a cycle attracts what starts near it; icmj run shows where other motions go."
    if prediction.cycle:
        peaks = amounts(prediction.amplitude, prediction.outputs, prediction.output_units)
        size = "" if prediction.amplitude is None else f", with peaks of {peaks}"
        return f"By the linear theory it stands, and sways on a cycle{size}; icmj run shows the motion."
    if not prediction.observer_feedback_stable:
        return "Even continuous feedback of this design would not hold it; icmj run shows whether it falls."
    return "No cycle is predicted; icmj run shows whether it stands."
