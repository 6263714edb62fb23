"""A panel of a case: its letter, its drawing and its caption, kept together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from icmj.report import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


from icmj.report.case_runs import CaseRuns

SHOWN = 8  # intervals at the end of a run
LEAST = 1e-16  # relative error that is drawn of what agrees to the last digit


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
