"""Runs under noise in axes: the histogram of intervals, and the spectrum of one output."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import is_between
from icmj.case.quantity import quantities
from icmj.report import style
from icmj.report.case_runs import CaseRuns

if TYPE_CHECKING:
    from matplotlib.axes import Axes


FASTEST = 10.0  # [Hz] drawn: a body this heavy sways no faster
LOWEST = 1e-6  # of the largest density drawn


def draw_histogram(axes: Axes, case: CaseRuns) -> None:
    """Density of the open-loop intervals on each plant; predicted Δ_crit dotted, the least interval dashed."""
    for plant, result in case.runs.items():
        found = result.statistics
        if found is not None and len(found.counts):
            density = found.counts / (found.counts.sum() * np.diff(found.edges))
            axes.stairs(density, found.edges, label=style.NAME[plant], **_line(plant))
    least = case.first.simulation.least
    if least > 0:
        axes.axvline(least, label=rf"least, {least:.3g} s", **style.EXACT)
    if case.prediction.cycle and case.prediction.delta_crit is not None:
        name = rf"$\Delta_{{crit}}={case.prediction.delta_crit:.4g}$ s"
        axes.axvline(case.prediction.delta_crit, label=name, **style.CRITICAL)
    axes.set(xlabel=r"$\Delta_{ol}$ (s)", ylabel="density (1/s)")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)


def draw_spectrum(axes: Axes, case: CaseRuns, output: int) -> None:
    """Power spectrum of one output on each plant, confidence of the last, and the predicted cycle's frequency."""
    name, shown = case.first.actual.outputs[output], quantities(case.first.actual)[output]
    largest = 0.0
    for plant, result in case.runs.items():
        if result.statistics is None:
            continue
        spectrum = result.statistics.spectrum
        drawn = (spectrum.frequency > 0) & is_between(spectrum.frequency, 0.0, FASTEST)
        frequency = spectrum.frequency[drawn]
        power, low, high = (
            values[drawn, output] * shown.factor**2 for values in (spectrum.power, spectrum.low, spectrum.high)
        )
        largest = max(largest, float(power.max(initial=0.0)))
        if result is case.last:
            axes.fill_between(frequency, low, high, label="95 %", **style.BAND)
        axes.loglog(frequency, power, label=style.NAME[plant], **style.RUN[plant])
    if case.prediction.cycle and case.prediction.period is not None:
        axes.axvline(1 / case.prediction.period, label="predicted cycle", **style.CRITICAL)
    axes.set_ylim(bottom=LOWEST * (largest or 1.0))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(shown.label(style.words(name) if case.first.actual.n_y > 1 else "power", "²/Hz"))


def _line(plant: str) -> dict[str, Any]:
    return {key: style.RUN[plant][key] for key in ("color", "linewidth")}
