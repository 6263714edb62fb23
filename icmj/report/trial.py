"""The figure of runs under a controller that is not intermittent: outputs and inputs over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from icmj.report import style
from icmj.result.tried import Tried
from icmj.view.quantity import in_brackets, quantities, shared_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST = 20.0  # s that are drawn, the last of the run: more is a smear


def trial_figure(runs: Sequence[Tried]) -> Figure:
    """Every output of one case, and its inputs beneath, on each plant."""
    first = runs[0]
    shown = quantities(first.actual)
    figure, stack = style.new_figure(style.TALL, first.actual.n_y + 1)
    for run in runs:
        t, line, name = run.simulation.t, style.RUN[run.simulation.plant], style.NAME[run.simulation.plant]
        for i, axes in enumerate(stack[:-1]):
            axes.plot(t, shown[i].factor * run.simulation.y[:, i], label=name, **line)
            axes.set_ylabel(shown[i].label(style.words(first.actual.outputs[i])))
        for i in range(first.actual.n_u):
            stack[-1].plot(t, run.simulation.u[:, i], label=name if i == 0 else None, **line)
    end = max(float(run.simulation.t[-1]) for run in runs)
    for axes in stack:
        axes.set_xlim(max(0.0, end - LONGEST), end)
        drawn = [np.asarray(line.get_xydata(), dtype=float) for line in axes.get_lines()]
        seen = np.concatenate([points[points[:, 0] >= end - LONGEST, 1] for points in drawn])
        low, high = float(seen.min()), float(seen.max())
        if np.isfinite(high - low) and high > low:
            axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    stack[-1].set(xlabel="time (s)", ylabel=f"u{in_brackets(shared_unit(first.actual.input_units))}")
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure
