"""Panel (b): the eigenvalues of φ(Δ_ol) in the complex plane, coloured by the open-loop interval."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.axes.eigenvalues import draw_locus, draw_scale
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    box = axes.get_position()
    axes.set_position((box.x0, box.y0, box.width * 0.84, box.height))
    draw_locus(axes, case)
    draw_scale(figure.add_axes((box.x0 + box.width * 0.875, box.y0, box.width * 0.03, box.height)), case)
    style.legend(figure, axes)
    return figure


def _describe(case: CaseRuns) -> str:
    return "Eigenvalues λ of φ(Δ_ol) near the unit circle, coloured by Δ_ol; arrowheads point towards longer intervals."


PANEL = Panel("b", _draw, _describe)
