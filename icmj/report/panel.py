"""A panel of a case: its letter, what draws it, what describes it, and which cases have it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from icmj.report import style
from icmj.report.case_runs import CaseRuns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_alone(draw: Callable[[Axes], object], linked: Literal["time", "plane"] | None = None) -> Figure:
    """A figure of one axes, its legend above it; ``linked`` if the page moves a cursor in it (:func:`style.link`)."""
    figure, (axes,) = style.new_figure()
    draw(axes)
    if linked is not None:
        style.link(linked, axes)
    style.legend(figure, axes)
    return figure


@dataclass(frozen=True)
class Panel:
    """One of the panels of a case.

    Attributes:
        letter: of its own; (a) to (f) are the paper's.
        drawing: draws it from the runs of a case, without its letter.
        caption: describes it in words.
        applies: whether a case has it; the paper's six are drawn of every case.
    """

    letter: str
    drawing: Callable[[CaseRuns], Figure]
    caption: Callable[[CaseRuns], str]
    applies: Callable[[CaseRuns], bool] = lambda case: True

    def draw(self, case: CaseRuns) -> Figure:
        """The figure, with the letter on it."""
        figure = self.drawing(case)
        style.letter(figure, f"({self.letter})")
        return figure
