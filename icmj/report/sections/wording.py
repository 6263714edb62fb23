"""Sentences that more than one section says."""

from __future__ import annotations

from icmj.report.pairing import CaseRuns
from icmj.report.style import NAME


def verdicts(case: CaseRuns) -> list[str]:
    """The verdict on both plants in one sentence where they agree, else one each."""
    words = {plant: comparison.words for plant, comparison in case.comparisons.items()}
    if len(words) == 2 and len(set(words.values())) == 1:
        return [f"Both plants: {_lower(next(iter(words.values())))}"]
    return [
        f"{NAME[plant].capitalize() if plant == 'linear' else NAME[plant]}: {_lower(text)}"
        for plant, text in words.items()
    ]


def count(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
