"""Figure of quiet standing: distributions of position and intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from icmj.experiments.quiet_standing import Standing
from icmj.report import style
from icmj.report.intersection_point import LINE, Shown, coloured

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def standing_figure(found: Sequence[Shown]) -> Figure:
    """Left: density of the first signal in units of its deviation, dotted: normal; right: density of the intervals."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(150 * style.MM, 70 * style.MM))
    place, times = (figure.add_axes((left, 0.14, 0.4, 0.68)) for left in (0.09, 0.58))
    edges = np.linspace(-4, 4, 61)
    middle = (edges[1:] + edges[:-1]) / 2
    for one, colour, words in coloured(found):
        if not isinstance(one.finding, Standing):
            continue
        density, _ = np.histogram(one.finding.positions[:, 0], edges, density=True)
        place.plot(middle, density, color=colour, linestyle=LINE[one.plant], linewidth=1.2, label=words)
        intervals = one.finding.intervals
        if len(intervals) > 1 and np.ptp(intervals) > 1e-6 * intervals.mean():
            counts, bins = np.histogram(intervals, 40, density=True)
            times.stairs(counts, bins, color=colour, linestyle=LINE[one.plant], linewidth=1.2)
    place.plot(middle, np.exp(-(middle**2) / 2) / np.sqrt(2 * np.pi), **style.CRITICAL)
    place.set(xlabel="position (deviations)", ylabel="density")
    times.set(xlabel=r"interval $\Delta_{ol}$ (s)", ylabel="density (1/s)")
    if not times.patches:
        times.set_visible(False)
    style.legend(figure, place, columns=2)
    return figure
