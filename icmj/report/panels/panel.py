"""A panel: its letter, its drawing and its caption, kept together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.pairing import CaseRuns

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Panel:
    """One of the panels of a case.

    Attributes:
        letter: (a) to (f) are the paper's.
        drawing: draws it from the runs of a case, without its letter.
        caption: describes it in words.
        there: whether a case has it; the paper's six are drawn of every case.
    """

    letter: str
    drawing: Callable[[CaseRuns], Figure]
    caption: Callable[[CaseRuns], str]
    there: Callable[[CaseRuns], bool] = lambda case: True

    def draw(self, case: CaseRuns) -> Figure:
        """The figure, with the letter on it."""
        figure = self.drawing(case)
        style.letter(figure, f"({self.letter})")
        return figure


def compares(case: CaseRuns) -> bool:
    """Whether runs are compared with the orbit and the interval of Δ_crit: not under noise where none is predicted."""
    return case.prediction.cycle or not case.first.simulation.noisy


def shown_interval(case: CaseRuns) -> float | None:
    """Δ_crit [s] where the intervals of the runs are compared with it."""
    return case.prediction.delta_crit if compares(case) else None
