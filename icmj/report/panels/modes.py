"""Panel (f): the eigendecomposition χ of x̄ for the latter part of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.report import style
from icmj.report.pairing import CaseRuns
from icmj.report.panels.panel import Panel
from icmj.view.laid_orbit import laid_orbit
from icmj.view.motion import modes, reduced
from icmj.view.timeline import latter_part

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 6  # intervals


def _draw(case: CaseRuns) -> Figure:
    """(f) χ_k1 and the norm of the other elements of χ against time, events and ±γ dotted.

    Where χ is undefined (no Δ_crit), the norm of x̄ is drawn instead.
    """
    if case.prediction.V_inv is None:
        return _draw_norm(case)
    figure, (critical, others) = style.new_figure(rows=2)
    top = case.last
    start, end = latter_part(top.simulation, SHOWN)
    for axes in (critical, others):
        events = top.simulation.events.t
        style.event_lines(axes, events[(events >= start) & (events <= end)])
    laid = laid_orbit(top) if case.prediction.cycle else None
    if laid is not None:
        t = laid.times(start, end)
        chi = modes(top, laid.at(t, laid.reduced))
        critical.plot(t, chi[:, 0].real, label="predicted", **style.PREDICTED)
        others.plot(t, np.linalg.norm(chi[:, 1:], axis=1), **style.PREDICTED)
    for plant, result in case.runs.items():
        simulation = result.simulation
        late = (simulation.t >= start) & (simulation.t <= end)
        chi = modes(result, reduced(result, simulation.x[late], simulation.x_o[late], simulation.x_h[late]))
        critical.plot(simulation.t[late], chi[:, 0].real, label=style.NAME[plant], **style.RUN[plant])
        others.plot(simulation.t[late], np.linalg.norm(chi[:, 1:], axis=1), **style.RUN[plant])
    if case.prediction.gamma is not None:
        for n, sign in enumerate((1, -1)):
            critical.axhline(sign * case.prediction.gamma, label=r"$\pm\gamma$" if n == 0 else None, **style.CRITICAL)
    for axes in (critical, others):
        axes.locator_params(axis="y", nbins=4, steps=[1, 2, 5, 10])
    critical.set_xlim(start, end)
    critical.set_ylabel(r"$\chi_{k_1}$")
    others.set_ylabel(r"$\|\chi_{k\neq k_1}\|$")
    others.set_ylim(bottom=0)
    others.set_xlabel("$t$ (s)")
    figure.align_ylabels([critical, others])
    style.legend(figure, critical)
    return figure


def _draw_norm(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    style.event_lines(axes, case.last.simulation.events.t)
    for plant, result in case.runs.items():
        simulation = result.simulation
        norm = np.linalg.norm(reduced(result, simulation.x, simulation.x_o, simulation.x_h), axis=1)
        axes.semilogy(simulation.t, np.maximum(norm, 1e-300), label=style.NAME[plant], **style.RUN[plant])
    axes.set(xlim=(0, float(case.last.simulation.t[-1])), xlabel="$t$ (s)", ylabel=r"$\|\bar{x}\|$  ($\chi$ undefined)")
    style.legend(figure, axes)
    return figure


def _caption(case: CaseRuns) -> str:
    if case.prediction.V_inv is None:
        return "Norm of x̄: without Δ_crit there is no V, hence no χ."
    return "Critical mode and norm of the others, latter part; dotted: events and ±γ."


MODES = Panel("f", _draw, _caption)
