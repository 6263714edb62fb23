"""Panels (c) and (e): outputs and open-loop intervals against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.errors import ReportError
from icmj.report import style
from icmj.report.pairing import CaseRuns
from icmj.report.panels.panel import Panel, shown_interval
from icmj.view.laid_orbit import laid_orbit
from icmj.view.quantity import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from icmj.simulation.simulation import Simulation

LEAST = 1e-16  # relative error that is drawn of what agrees to the last digit


def _draw_outputs(case: CaseRuns) -> Figure:
    """(c) Outputs of the run and, if it is there, under continuous control against time, with events dotted."""
    figure = style.each_output(case.last.actual.n_y, lambda axes, i: draw_output(axes, case, i), "$t$ (s)")
    style.link("time", *figure.axes)
    return figure


def draw_output(axes: Axes, case: CaseRuns, output: int) -> None:
    """One output of the run and, if it is there, under continuous control against time, with events dotted."""
    top = case.last
    name, shown = top.actual.outputs[output], quantities(top.actual)[output]
    laid = laid_orbit(top) if case.prediction.cycle else None
    style.event_lines(axes, top.simulation.events.t)
    if laid is not None:
        whole = laid.whole(laid.orbit.y)[:, output] * shown.factor
        axes.axhspan(whole.min(), whole.max(), label="predicted range", **style.BAND)
    reach = 0.0
    for plant, result in case.runs.items():
        y = result.simulation.y[:, output] * shown.factor
        reach = max(reach, float(np.abs(y[np.isfinite(y)]).max(initial=0.0)))
        axes.plot(result.simulation.t, y, label=style.NAME[plant], **style.RUN[plant])
    reach = reach or 1.0
    if (continuous := _continuous(case)) is not None:
        y_c = continuous.y[:, output] * shown.factor
        # an unstable continuous controller would flatten everything else
        inside = np.where(np.abs(y_c) < 3 * reach, y_c, np.nan)
        axes.plot(continuous.t, inside, label="$y_c$", **style.CONTINUOUS)
    axes.set_ylim(-1.12 * reach, 1.12 * reach)
    axes.margins(x=0)
    axes.set(xlabel="$t$ (s)", ylabel=shown.label(style.words(name) if top.actual.n_y > 1 else "$y$"))


def _continuous(case: CaseRuns) -> Simulation | None:
    """The run under continuous control: on MuJoCo if there, else on the linear plant, or none."""
    runs = (result.continuous for result in reversed(case.runs.values()))
    return next((run for run in runs if run is not None), None)


def _draw_intervals(case: CaseRuns) -> Figure:
    if not _settles(case):
        figure, (axes,) = style.new_figure()
        draw_intervals(axes, case)
        style.link("time", axes)
        style.legend(figure, axes)
        return figure
    figure, (axes, strip) = style.new_figure(style.MIDDLE, shares=(2.2, 1))
    draw_intervals(axes, case)
    draw_interval_errors(strip, case)
    axes.set_xlabel("")
    figure.align_ylabels([axes, strip])
    style.link("time", axes, strip)
    style.legend(figure, axes)
    return figure


def _settles(case: CaseRuns) -> bool:
    return case.prediction.cycle and not case.first.simulation.noisy


def draw_intervals(axes: Axes, case: CaseRuns) -> None:
    """(e) Open-loop interval at each event against time, Δ_crit dotted where it is to be compared with."""
    delta_crit = shown_interval(case)
    largest = 0.0 if delta_crit is None else delta_crit
    for plant, result in case.runs.items():
        events = result.simulation.events
        if len(events):
            largest = max(largest, float(events.interval.max()))
        look = {**style.RUN[plant], **style.MARK[plant], "linewidth": 0.6 if len(events) <= style.CROWDED else 0.3}
        if len(events) > style.CROWDED:
            look["markersize"] *= 0.6
        axes.plot(events.t, events.interval, label=style.NAME[plant], **look)
    if delta_crit is not None:
        axes.axhline(delta_crit, label=rf"$\Delta_{{crit}}={delta_crit:.4g}$ s", **style.CRITICAL)
    axes.set(
        xlim=(0, float(case.last.simulation.t[-1])),
        ylim=(0, 1.15 * largest or 1.0),
        xlabel="$t$ (s)",
        ylabel=r"$\Delta_{ol}$ (s)",
    )


def draw_interval_errors(axes: Axes, case: CaseRuns) -> None:
    """Magnitude of the relative error of each open-loop interval with respect to Δ_crit, on a logarithmic axis.

    Raises:
        ReportError: if there is no Δ_crit.
    """
    delta = case.prediction.delta_crit
    if delta is None:
        raise ReportError(f"case {case.name!r}: no Δ_crit, which errors of intervals are relative to")
    for plant, result in case.runs.items():
        events, look = result.simulation.events, dict(style.MARK[plant])
        look["markersize"] *= 0.6
        error = np.maximum(np.abs(events.interval / delta - 1), LEAST)
        axes.plot(events.t, error, linestyle="none", label=style.NAME[plant], **look)
    style.residual(axes, "rel. error")
    axes.set(xlim=(0, float(case.last.simulation.t[-1])), xlabel="$t$ (s)")


def _output_caption(case: CaseRuns) -> str:
    several = "s" if len(case.first.actual.outputs) > 1 else ""
    band = " Faint band: predicted range." if case.prediction.cycle else ""
    beside = ", and under continuous control of the same design (y_c)" if _continuous(case) is not None else ""
    return f"Output{several} under intermittent control on each plant{beside}; dotted: events.{band}"


def _interval_caption(case: CaseRuns) -> str:
    dotted = ""
    if shown_interval(case) is not None:
        predicted = "predicted interval Δ_crit" if case.prediction.cycle else "Δ_crit, at which no cycle is predicted"
        dotted = f"; dotted: {predicted}"
    beneath = ". Beneath: magnitude of the relative error, |Δ_ol/Δ_crit − 1|" if _settles(case) else ""
    return f"Open-loop interval Δ_ol that ends at each event{dotted}{beneath}."


OUTPUTS = Panel("c", _draw_outputs, _output_caption)
INTERVALS = Panel("e", _draw_intervals, _interval_caption)
