"""Panel (a): the largest eigenvalue of φ(Δ_ol) against the open-loop interval."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.report.axes.eigenvalues import draw_modulus
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel, draw_alone

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    return draw_alone(lambda axes: draw_modulus(axes, case))


def _describe(case: CaseRuns) -> str:
    measured = any(result.growth is not None for result in case.runs.values())
    points = " Points: growth measured in clock-driven simulations." if measured else ""
    return (
        "Largest magnitude of the eigenvalues λ of φ(Δ_ol), which maps the state at one event to the next, against a "
        f"constant interval Δ_ol; with the changes of the plant (ρ = 1) and without (ρ = 0).{points}"
    )


PANEL = Panel("a", _draw, _describe)
