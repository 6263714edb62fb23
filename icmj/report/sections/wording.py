"""Sentences that several sections use."""

from __future__ import annotations

from icmj.base import numbers
from icmj.comparison.comparison import Comparison
from icmj.report.pairing import CaseRuns
from icmj.report.style import NAME

# mark, word and explanation of what a run did, beside what was predicted
_AS_PREDICTED = ("✓", "agrees", "settles on the predicted cycle")
_NONE_AS_PREDICTED = ("✓", "none, agrees", "settles on no cycle, and none is predicted")
_ANOTHER = ("○", "another cycle", "settles on a cycle that is not the predicted one")
_UNPREDICTED = ("○", "another cycle", "settles on a cycle where linear theory predicts none")
_REPELLED = ("✓", "agrees", "the predicted cycle does not attract, and the run settles on none")
_MISSED = ("✗", "not reached", "does not settle, although the predicted cycle attracts")


def reached(comparison: Comparison | None) -> tuple[str, str, str]:
    """How a run agrees with its prediction: a mark, a word and an explanation."""
    if comparison is None:
        return numbers.MISSING, "", "no run"
    if comparison.measured.kind == "noisy":
        return numbers.MISSING, "under noise", "a motion under noise has no cycle"
    settled, predicted = comparison.measured.kind == "cycle", comparison.predicted
    if comparison.measured.converged:
        return _AS_PREDICTED
    if not predicted.cycle:
        return _UNPREDICTED if settled else _NONE_AS_PREDICTED
    if settled:
        return _ANOTHER
    return _MISSED if predicted.verdict == "attracting" else _REPELLED


def verdicts(case: CaseRuns) -> list[str]:
    """The verdict on both plants in one sentence where they agree, else one each."""
    words = {plant: comparison.words for plant, comparison in case.comparisons.items()}
    if len(words) == 2 and len(set(words.values())) == 1:
        return [f"Both plants: {_lower(next(iter(words.values())))}"]
    return [
        f"{NAME[plant].capitalize() if plant == 'linear' else NAME[plant]}: {_lower(text)}"
        for plant, text in words.items()
    ]


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
