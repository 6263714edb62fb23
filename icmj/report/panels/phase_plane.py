"""Panel (d): velocity against position in the last part of the run, over the predicted orbit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.case.quantity import quantities
from icmj.report import style
from icmj.report.axes.phase import draw_phase
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    count = case.last.actual.n_y
    if case.last.simulation.noisy and count > 1:  # on each other they would be a tangle
        figure, stack = style.new_figure(style.TALL, count)
        for output, axes in enumerate(stack):
            draw_phase(axes, case, [output])
            axes.set_xlabel(axes.get_xlabel() if axes is stack[-1] else "")
            axes.set_ylabel(
                quantities(case.last.actual)[output].label(style.words(case.last.actual.outputs[output]), "/s")
            )
        figure.align_ylabels(stack)
        style.link("plane", *stack)
        style.legend(figure, stack[0])
        return figure
    figure, (axes,) = style.new_figure(style.TALL if count > 1 else style.HEIGHT)
    draw_phase(axes, case)
    style.link("plane", axes)
    style.legend(figure, axes)
    return figure


def _describe(case: CaseRuns) -> str:
    each = ", one output in each" if case.last.simulation.noisy and case.last.actual.n_y > 1 else ""
    return f"Velocity against position in the last part of the run{each}; circles: states at events."


PANEL = Panel("d", _draw, _describe)
