"""The spread of intervals under the noise of a run file: predicted, or why not, and in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.errors import IcmjError

if TYPE_CHECKING:
    from icmj.case.case import Case
    from icmj.theory.spread import Spread


def find_spread(case: Case) -> Spread | str:
    """How the intervals vary under the noise of the run file, or why that is not predicted; "" without noise."""
    if case.prediction is None or not case.settings.noisy:
        return ""
    try:
        return case.spread()
    except IcmjError as error:
        return str(error)


def say_spread(spread: Spread | str) -> str:
    """The same as a sentence."""
    words = spread if isinstance(spread, str) else spread.words
    return words and f"{words[0].upper()}{words[1:]}."
