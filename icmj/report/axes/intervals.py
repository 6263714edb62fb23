"""Open-loop intervals against time in axes, or their relative errors with respect to Δ_crit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.errors import ReportError
from icmj.report import style
from icmj.report.axes import LEAST_ERROR
from icmj.report.case_runs import CaseRuns, shown_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
        error = np.maximum(np.abs(events.interval / delta - 1), LEAST_ERROR)
        axes.plot(events.t, error, linestyle="none", label=style.NAME[plant], **look)
    style.residual(axes, "rel. error")
    axes.set(xlim=(0, float(case.last.simulation.t[-1])), xlabel="$t$ (s)")
