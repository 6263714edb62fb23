"""Panel (d): velocity against position for the latter part of the run, over the predicted orbit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import Array
from icmj.report import style
from icmj.report.pairing import CaseRuns
from icmj.report.panels.window import DEGREES, latter_part, orbit_sign
from icmj.result.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INTERVALS = 8


def phase_panel(case: CaseRuns) -> Figure:
    """(d) Velocity against position of every output, with the states at events marked."""
    outputs = case.last.actual.outputs
    figure, (axes,) = style.new_figure(style.TALL if len(outputs) > 1 else style.HEIGHT)
    prediction = case.prediction
    for i, name in enumerate(outputs):
        if prediction.orbit is not None:
            orbit, sign = prediction.orbit, orbit_sign(case.last)
            y, v = orbit.y[:, i], velocity(case.first, orbit.X[:, : case.first.actual.n], orbit.u)[:, i]
            y, v = (sign * DEGREES * np.concatenate([s, orbit.sign * s]) for s in (y, v))
            label = {"attracting": "predicted", "repelling": "repelling orbit"}.get(
                prediction.verdict, "not admissible"
            )
            axes.plot(y, v, label=label if i == 0 else None, **style.PREDICTED)
        for plant, result in case.runs.items():
            simulation = result.simulation
            start, end = latter_part(result, INTERVALS)
            late = (simulation.t >= start) & (simulation.t <= end)
            v = velocity(result, simulation.x[late], simulation.u[late])[:, i] * DEGREES
            y = simulation.y[late, i] * DEGREES
            axes.plot(y, v, label=style.NAME[plant] if i == 0 else None, **style.RUN[plant])
            if result is case.last and len(outputs) > 1 and len(y):
                _label(axes, name, float(y[np.argmax(v)]), float(v.max()))
        _mark_events(axes, case.last, i)
    axes.set(xlabel="position $x_2$ (deg)", ylabel="velocity $x_1$ (deg/s)")
    if len(outputs) > 1:
        axes.set(xlabel="segment angle (deg)", ylabel="segment velocity (deg/s)")
    axes.margins(0.08)
    style.letter(figure, "(d)")
    style.legend(figure, axes)
    return figure


def velocity(result: Result, x: Array, u: Array) -> Array:
    """ẏ = CAx + CBu of the actual plant, shape (N, n_y); with positions as outputs these are their velocities."""
    plant = result.actual
    return x @ (plant.C @ plant.A).T + u @ (plant.C @ plant.B).T


def _label(axes: Axes, name: str, y: float, v: float) -> None:
    behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
    axes.annotate(
        name, (y, v), xytext=(0, 4), textcoords="offset points", ha="center", style="italic", bbox=behind, zorder=6
    )


def _mark_events(axes: Axes, result: Result, output: int) -> None:
    events = result.simulation.events
    start, end = latter_part(result, INTERVALS)
    late = (events.t >= start) & (events.t <= end)
    if not late.any():
        return
    x = events.x[late]
    u = -events.x_h[late] @ result.controller.design.k.T
    y, v = (x @ result.actual.C.T)[:, output] * DEGREES, velocity(result, x, u)[:, output] * DEGREES
    if result.measurement.kind == "cycle" and len(result.actual.outputs) == 1:
        for n in range(-min(result.measurement.p or 0, len(y)), 0):
            axes.axvline(y[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
            axes.axhline(v[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
    axes.plot(
        y, v, "o", markersize=3.2, markerfacecolor="white", markeredgecolor="#222222", markeredgewidth=0.8,
        label="at events" if output == 0 else None, zorder=5,
    )  # fmt: skip
