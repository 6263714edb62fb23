"""Panel (c): outputs against time, one above the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.axes.outputs import draw_output, find_continuous
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    """(c) Outputs of the run and, if it is there, under continuous control against time, with events dotted."""
    figure = style.each_output(case.last.actual.n_y, lambda axes, i: draw_output(axes, case, i), "$t$ (s)")
    style.link("time", *figure.axes)
    return figure


def _describe(case: CaseRuns) -> str:
    several = "s" if len(case.first.actual.outputs) > 1 else ""
    band = " Faint band: predicted range." if case.prediction.cycle else ""
    beside = ", and under continuous control of the same design (y_c)" if find_continuous(case) is not None else ""
    return f"Output{several} under intermittent control on each plant{beside}; dotted: events.{band}"


PANEL = Panel("c", _draw, _describe)
