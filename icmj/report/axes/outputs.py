"""One output against time in axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.case.laid_orbit import lay_orbit
from icmj.case.quantity import quantities
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.simulation.simulation import Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_output(axes: Axes, case: CaseRuns, output: int) -> None:
    """One output of the run and, if it is there, under continuous control against time, with events dotted."""
    top = case.last
    name, shown = top.actual.outputs[output], quantities(top.actual)[output]
    laid = lay_orbit(top) if case.prediction.cycle else None
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
    if (continuous := find_continuous(case)) is not None:
        y_c = continuous.y[:, output] * shown.factor
        # an unstable continuous controller would flatten everything else
        inside = np.where(np.abs(y_c) < 3 * reach, y_c, np.nan)
        axes.plot(continuous.t, inside, label="$y_c$", **style.CONTINUOUS)
    axes.set_ylim(-1.12 * reach, 1.12 * reach)
    axes.margins(x=0)
    axes.set(xlabel="$t$ (s)", ylabel=shown.label(style.words(name) if top.actual.n_y > 1 else "$y$"))


def find_continuous(case: CaseRuns) -> Simulation | None:
    """The run under continuous control: on MuJoCo if there, else on the linear plant, or none."""
    runs = (result.continuous for result in reversed(case.runs.values()))
    return next((run for run in runs if run is not None), None)
