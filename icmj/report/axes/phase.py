"""Velocity against position in axes, for the last part of the run, over the predicted orbit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import is_between
from icmj.case.laid_orbit import beside, lay_orbit
from icmj.case.motion import curve, event_rows, latter_part, output_rate
from icmj.case.quantity import Quantity, quantities
from icmj.report import style
from icmj.report.axes import LAST_INTERVALS
from icmj.report.case_runs import CaseRuns, compares

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from icmj.case.result import Result


def draw_phase(axes: Axes, case: CaseRuns, chosen: Sequence[int] = ()) -> None:
    """(d) Velocity against position of every output, or of those chosen, with the states at events marked."""
    outputs = case.last.actual.outputs
    chosen = chosen or range(len(outputs))
    prediction, laid = case.prediction, lay_orbit(case.last) if compares(case) else None
    units = quantities(case.last.actual)
    drawn = {
        plant: curve(result, *latter_part(result.simulation, LAST_INTERVALS)) for plant, result in case.runs.items()
    }
    for i in chosen:
        name, shown, first = outputs[i], units[i], i == chosen[0]
        if laid is not None:
            y, v = (laid.whole(signal)[:, i] * shown.factor for signal in (laid.orbit.y, laid.rate))
            verdict = beside(prediction, case.last.motion).verdict
            label = {"attracting": "predicted", "family": "predicted, of a family", "repelling": "repelling orbit"}.get(
                verdict, "not admissible"
            )
            axes.plot(y, v, label=label if first else None, **style.PREDICTED)
        for plant, result in case.runs.items():
            y, v = (signal[:, i] * shown.factor for signal in drawn[plant])
            axes.plot(y, v, label=style.NAME[plant] if first else None, **style.RUN[plant])
            if result is case.last and len(chosen) > 1 and len(y):
                _label(axes, style.words(name), float(y[np.nanargmax(v)]), float(np.nanmax(v)))
        _mark_events(axes, case.last, i, shown, first)
    axes.set(xlabel=_label_of("position $x_2$", units), ylabel=_label_of("velocity $x_1$", units, "/s"))
    if len(outputs) > 1:
        angles = units[0].unit == "deg" and len(set(units)) == 1
        words = ("segment angle", "segment velocity") if angles else ("output", "rate of the output")
        axes.set(xlabel=_label_of(words[0], units), ylabel=_label_of(words[1], units, "/s"))
    axes.margins(0.08)


def _label_of(words: str, units: tuple[Quantity, ...], per: str = "") -> str:
    """With the unit of all; outputs of several units share one scale of SI numbers and degrees."""
    return units[0].label(words, per) if len(set(units)) == 1 else f"{words} (each in its own unit)"


def _label(axes: Axes, name: str, y: float, v: float) -> None:
    behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
    axes.annotate(
        name, (y, v), xytext=(0, 4), textcoords="offset points", ha="center", style="italic", bbox=behind, zorder=6
    )


def _mark_events(axes: Axes, result: Result, output: int, shown: Quantity, named: bool) -> None:
    simulation = result.simulation
    start, end = latter_part(simulation, LAST_INTERVALS)
    rows = event_rows(simulation)
    rows = rows[is_between(simulation.t[rows], start, end)]
    if not len(rows):
        return
    y = simulation.y[rows, output] * shown.factor
    v = output_rate(result, simulation.x[rows], simulation.u[rows])[:, output] * shown.factor
    if result.motion.kind == "cycle" and len(result.actual.outputs) == 1:
        for n in range(-min(result.motion.p or 0, len(y)), 0):
            axes.axvline(y[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
            axes.axhline(v[n], color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.5)
    axes.plot(
        y, v, "o", markersize=3.2, markerfacecolor="white", markeredgecolor="#222222", markeredgewidth=0.8,
        label="at events" if named else None, zorder=5,
    )  # fmt: skip
