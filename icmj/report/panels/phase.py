"""Panel (d): velocity against position for the latter part of the run, over the predicted orbit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.report import style
from icmj.report.pairing import CaseRuns
from icmj.report.panels.panel import Panel
from icmj.report.style import DEGREES
from icmj.result.result import Result
from icmj.view.laid_orbit import laid_orbit
from icmj.view.motion import output_rate
from icmj.view.timeline import event_rows, latter_part

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 8  # intervals


def _draw(case: CaseRuns) -> Figure:
    """(d) Velocity against position of every output, with the states at events marked."""
    outputs = case.last.actual.outputs
    figure, (axes,) = style.new_figure(style.TALL if len(outputs) > 1 else style.HEIGHT)
    prediction, laid = case.prediction, laid_orbit(case.last)
    for i, name in enumerate(outputs):
        if laid is not None:
            y, v = (laid.whole(signal)[:, i] * DEGREES for signal in (laid.orbit.y, laid.rate))
            label = {"attracting": "predicted", "repelling": "repelling orbit"}.get(
                prediction.verdict, "not admissible"
            )
            axes.plot(y, v, label=label if i == 0 else None, **style.PREDICTED)
        for plant, result in case.runs.items():
            simulation = result.simulation
            start, end = latter_part(simulation, SHOWN)
            late = (simulation.t >= start) & (simulation.t <= end)
            v = output_rate(result, simulation.x[late], simulation.u[late])[:, i] * DEGREES
            y = simulation.y[late, i] * DEGREES
            axes.plot(y, v, label=style.NAME[plant] if i == 0 else None, **style.RUN[plant])
            if result is case.last and len(outputs) > 1 and len(y):
                _label(axes, name, float(y[np.argmax(v)]), float(v.max()))
        _mark_events(axes, case.last, i)
    axes.set(xlabel="position $x_2$ (deg)", ylabel="velocity $x_1$ (deg/s)")
    if len(outputs) > 1:
        axes.set(xlabel="segment angle (deg)", ylabel="segment velocity (deg/s)")
    axes.margins(0.08)
    style.legend(figure, axes)
    return figure


def _label(axes: Axes, name: str, y: float, v: float) -> None:
    behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
    axes.annotate(
        name, (y, v), xytext=(0, 4), textcoords="offset points", ha="center", style="italic", bbox=behind, zorder=6
    )


def _mark_events(axes: Axes, result: Result, output: int) -> None:
    simulation = result.simulation
    start, end = latter_part(simulation, SHOWN)
    rows = event_rows(simulation)
    rows = rows[(simulation.t[rows] >= start) & (simulation.t[rows] <= end)]
    if not len(rows):
        return
    y = simulation.y[rows, output] * DEGREES
    v = output_rate(result, simulation.x[rows], simulation.u[rows])[:, output] * DEGREES
    if result.measurement.kind == "cycle" and len(result.actual.outputs) == 1:
        for n in range(-min(result.measurement.p or 0, len(y)), 0):
            axes.axvline(y[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
            axes.axhline(v[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
    axes.plot(
        y, v, "o", markersize=3.2, markerfacecolor="white", markeredgecolor="#222222", markeredgewidth=0.8,
        label="at events" if output == 0 else None, zorder=5,
    )  # fmt: skip


def _caption(case: CaseRuns) -> str:
    return "Velocity against position, latter part; circles: states at events."


PHASE = Panel("d", _draw, _caption)
