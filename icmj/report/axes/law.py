"""The amplitude law in axes: departures from the linear prediction against the threshold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.case.quantity import in_unit, threshold_unit
from icmj.case.result import AmplitudeLaw
from icmj.report.case_runs import CaseRuns

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def find_law(case: CaseRuns) -> tuple[AmplitudeLaw, str] | None:
    """The law of a case, that of the plant drawn on top if both were measured, and the unit of its threshold."""
    found = ((run.law, threshold_unit(run)) for run in reversed(case.runs.values()) if run.law is not None)
    return next(found, None)


def draw_law(axes: Axes, law: AmplitudeLaw, unit: str = "") -> None:
    """Relative errors of interval and amplitude against the threshold on logarithmic axes, with the fitted lines."""
    for values, slope, name, colour, marker in (
        (law.interval_error, law.interval_slope, "interval", "#0072b2", "o"),
        (law.amplitude_error, law.amplitude_slope, "amplitude", "#d55e00", "s"),
    ):
        size = np.abs(values)
        known = np.isfinite(size) & (size > 0)
        if not known.any():
            continue
        threshold, size = law.q_t[known], size[known]
        # the fitted line has the given slope and passes through the points' centre
        level = np.exp(np.mean(np.log(size)) - slope * np.mean(np.log(threshold)))
        span = np.geomspace(threshold.min() / 1.5, threshold.max() * 1.5, 2)
        axes.loglog(span, level * span**slope, color=colour, linewidth=0.8, linestyle=(0, (5, 1.5)))
        axes.loglog(
            threshold, size, marker, markersize=4, color=colour, markerfacecolor="white", markeredgewidth=1.0,
            label=f"{name}, slope {slope:.3f}",
        )  # fmt: skip
    axes.set(xlabel=in_unit("threshold", unit), ylabel="relative error")
