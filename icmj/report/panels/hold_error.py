"""Panel (i): the hold error from event to event, in a run under noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.case.laid_orbit import beside
from icmj.report.axes.hold_error import WITHIN, draw_hold_error, list_hold_errors, predict_spread
from icmj.report.case_runs import CaseRuns, compares
from icmj.report.panel import Panel, draw_alone

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    return draw_alone(lambda axes: draw_hold_error(axes, case))


def _describe(case: CaseRuns) -> str:
    orbit = beside(case.prediction, case.last.motion).orbit if compares(case) else None
    beneath = ""
    if orbit is not None:
        beneath = "; without colour: the predicted orbit"
        if predict_spread(case, orbit) is not None:
            beneath += f", with a band of {WITHIN} predicted standard deviations on either side"
    return (
        "Size of the hold error, in thresholds, over the time since the event, in each of the last intervals; dotted: "
        f"the threshold, at which the next event comes{beneath}."
    )


PANEL = Panel(
    "i", _draw, _describe,
    lambda case: case.last.simulation.noisy and any(list_hold_errors(result) for result in case.runs.values()),
)  # fmt: skip
