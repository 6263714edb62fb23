"""Panel (f): the critical mode and the norm of the others in the last part of the run, with the errors of the first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.axes.modes import draw_critical, draw_mode_errors, draw_norm, draw_others
from icmj.report.case_runs import CaseRuns, compares
from icmj.report.panel import Panel, draw_alone

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    """(f) χ_k1 and the norm of the other elements of χ against time, events and ±γ dotted.

    Where χ is undefined (no Δ_crit), the norm of x̄ is drawn instead.
    """
    if case.prediction.V_inv is None:
        return draw_alone(lambda axes: draw_norm(axes, case), "time")
    settles = case.prediction.cycle and not case.first.simulation.noisy
    if settles:
        figure, stack = style.new_figure(style.MIDDLE, shares=(1.2, 1.2, 1))
        draw_mode_errors(stack[2], case)
    else:
        figure, stack = style.new_figure(rows=2)
    critical, others = stack[:2]
    draw_critical(critical, case)
    draw_others(others, case)
    for axes in stack[:-1]:
        axes.set_xlabel("")
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, critical)
    return figure


def _describe(case: CaseRuns) -> str:
    if case.prediction.V_inv is None:
        return (
            "Norm of x̄, the states of the plant and the errors of the observer; dotted: events. There is no Δ_crit, so "
            "the modes χ are undefined."
        )
    beneath = ""
    if case.prediction.cycle and not case.first.simulation.noisy:
        beneath = " Beneath: relative error of the magnitude of χ_k1 at events with respect to γ."
    orbit = "" if case.prediction.cycle else f" on the {case.prediction.verdict} orbit of Δ_crit"
    gamma = (
        f", and ±γ, the {'predicted ' if not orbit else ''}values of χ_k1 at events{orbit}" if compares(case) else ""
    )
    return (
        "Critical mode χ_k1, the coordinate of the state along the eigenvector of λ_crit, and norm of the other modes "
        f"in the last part of the run; dotted: events{gamma}.{beneath}"
    )


PANEL = Panel("f", _draw, _describe)
