"""Whether runs do as predicted: a mark, a word and a sentence for each."""

from __future__ import annotations

from icmj.base import numbers
from icmj.case.comparison import Comparison, on_predicted_cycle
from icmj.measurement.measurement import Measurement
from icmj.report.case_runs import CaseRuns
from icmj.report.style import NAME
from icmj.theory.prediction import Prediction

# mark, word and explanation of what a run did, beside what was predicted
_AS_PREDICTED = ("✓", "agrees", "settles on the predicted cycle")
_NONE_AS_PREDICTED = ("✓", "none, agrees", "settles on no cycle, and none is predicted")
_ANOTHER = ("○", "another cycle", "settles on a cycle that is not the predicted one")
_UNPREDICTED = ("○", "another cycle", "settles on a cycle where linear theory predicts none")
_MISSED = ("✗", "not reached", "does not settle on a cycle, although one is predicted")


def judge_run(comparison: Comparison | None) -> tuple[str, str, str]:
    """How a run agrees with its prediction: a mark, a word and an explanation."""
    if comparison is None:
        return numbers.MISSING, "", "no run"
    if comparison.measured.kind == "noisy":
        return numbers.MISSING, "under noise", "a motion under noise has no cycle"
    measured, predicted = comparison.measured, comparison.predicted
    return _agreement(measured.converged, measured.kind == "cycle", predicted.cycle)


def judge_attractor(prediction: Prediction, measurement: Measurement) -> tuple[str, str]:
    """Mark and explanation of a motion that one of many starts leads to.

    They follow the rule of :func:`judge_run`, except that a start from which the predicted cycle is not reached does
    not contradict the prediction, which is local.
    """
    on = on_predicted_cycle(prediction, measurement)
    mark, _, said = _agreement(on, measurement.kind == "cycle", prediction.cycle)
    return ("○", "a motion beside the predicted cycle") if mark == "✗" else (mark, said)


def _agreement(on_predicted: bool, settled: bool, cycle: bool) -> tuple[str, str, str]:
    """The rule of all marks: what a motion did, beside whether a cycle is predicted."""
    if on_predicted:
        return _AS_PREDICTED
    if not cycle:
        return _UNPREDICTED if settled else _NONE_AS_PREDICTED
    return _ANOTHER if settled else _MISSED


def verdicts(case: CaseRuns) -> list[str]:
    """The verdict on both plants in one sentence where they agree, else one each."""
    words = {plant: comparison.words for plant, comparison in case.comparisons.items()}
    if len(words) == 2 and len(set(words.values())) == 1:
        return [f"Both plants: {_lower(next(iter(words.values())))}"]
    where = {"linear": "Linear plant", "mujoco": NAME["mujoco"]}
    return [f"{where[plant]}: {_lower(text)}" for plant, text in words.items()]


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
