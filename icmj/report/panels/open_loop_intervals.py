"""Panel (e): open-loop intervals against time, with their relative errors where a cycle is predicted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.axes.intervals import draw_interval_errors, draw_intervals
from icmj.report.case_runs import CaseRuns, shown_interval
from icmj.report.panel import Panel, draw_alone

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    if not _settles(case):
        return draw_alone(lambda axes: draw_intervals(axes, case), "time")
    figure, (axes, strip) = style.new_figure(style.MIDDLE, shares=(2.2, 1))
    draw_intervals(axes, case)
    draw_interval_errors(strip, case)
    axes.set_xlabel("")
    figure.align_ylabels([axes, strip])
    style.link("time", axes, strip)
    style.legend(figure, axes)
    return figure


def _settles(case: CaseRuns) -> bool:
    return case.prediction.cycle and not case.first.simulation.noisy


def _describe(case: CaseRuns) -> str:
    dotted = ""
    if shown_interval(case) is not None:
        predicted = "predicted interval Δ_crit" if case.prediction.cycle else "Δ_crit, at which no cycle is predicted"
        dotted = f"; dotted: {predicted}"
    beneath = ". Beneath: magnitude of the relative error, |Δ_ol/Δ_crit − 1|" if _settles(case) else ""
    return f"Open-loop interval Δ_ol that ends at each event{dotted}{beneath}."


PANEL = Panel("e", _draw, _describe)
