"""Panel (h): the centre of pressure of a body that stands on a floor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.axes.pressure import draw_pressure, find_pressures, pressed_axes
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    """(h) Centre of pressure against time, its place at rest dotted."""
    names = pressed_axes(case) or ["x"]
    figure, stack = style.new_figure(style.TALL if len(names) > 1 else style.HEIGHT, len(names))
    for axes, name in zip(stack, names, strict=True):
        draw_pressure(axes, case, name)
        axes.set_xlabel("$t$ (s)" if axes is stack[-1] else "")
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure


def _describe(case: CaseRuns) -> str:
    *_, (_, pressure) = find_pressures(case).values()
    return f"Centre of pressure; {pressure.words[-1]}."


PANEL = Panel("h", _draw, _describe, lambda case: bool(find_pressures(case)))
