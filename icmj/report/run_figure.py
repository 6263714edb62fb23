"""The figure of a run: every output of one case, and its inputs beneath, on each plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import is_between
from icmj.case.quantity import in_unit, quantities, shared_unit
from icmj.case.result import Result
from icmj.report import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST = 20.0  # s that are drawn, the last of the run: more is a smear


def run_figure(runs: Sequence[Result]) -> Figure:
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
        late = np.concatenate([points[is_between(points[:, 0], end - LONGEST), 1] for points in drawn])
        low, high = float(late.min()), float(late.max())
        if np.isfinite(high - low) and high > low:
            axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    stack[-1].set(xlabel="time (s)", ylabel=in_unit("u", shared_unit(first.actual.input_units)))
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure
