"""Panel (g): the inputs that act, where they differ from the command."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.axes.inputs import acting_inputs, draw_acting
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    """(g) Command and what acts, of every input where they differ; under noise the latter part."""
    inputs = acting_inputs(case)

    def draw(axes: Axes, k: int) -> None:
        draw_acting(axes, case, inputs[k])
        if len(inputs) > 1:  # names of inputs are longer than axes are high
            name, _, unit = axes.get_ylabel().partition(" (")
            axes.set_ylabel(f"({unit}" if unit else "")
            axes.text(0.01, 0.98, name, transform=axes.transAxes, va="top", style="italic")

    figure = style.each_output(len(inputs), draw, "$t$ (s)")
    style.link("time", *figure.axes)
    return figure


def _describe(case: CaseRuns) -> str:
    limits = any(float(r.simulation.precision.get("saturated_share", 0.0)) > 0 for r in case.runs.values())
    reason = "is limited by the actuators" if limits else "includes the disturbance"
    return f"Command of the controller, and the input that acts on the plant, which {reason}."


PANEL = Panel("g", _draw, _describe, lambda case: bool(acting_inputs(case)))
