"""The eigendecomposition χ of x̄ in axes, for the last part of the run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, is_between
from icmj.case.laid_orbit import lay_orbit
from icmj.case.motion import latter_part, modes, reduce_state
from icmj.errors import ReportError
from icmj.report import style
from icmj.report.axes import LEAST_ERROR
from icmj.report.case_runs import CaseRuns, compares

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SHOWN_MODES = 6  # intervals


def draw_critical(axes: Axes, case: CaseRuns) -> None:
    """The critical mode χ_k1 over the latter part of the runs, its prediction, ±γ and events dotted.

    Raises:
        ReportError: if χ is undefined, because there is no Δ_crit.
    """
    _draw_modes(axes, case, lambda chi: chi[:, 0].real)
    if case.prediction.gamma is not None and compares(case):
        for n, sign in enumerate((1, -1)):
            axes.axhline(sign * case.prediction.gamma, label=r"$\pm\gamma$" if n == 0 else None, **style.CRITICAL)
    axes.set_ylabel(r"$\chi_{k_1}$")


def draw_others(axes: Axes, case: CaseRuns) -> None:
    """The norm of the other modes over the latter part of the runs, its prediction, events dotted.

    Raises:
        ReportError: if χ is undefined, because there is no Δ_crit.
    """
    _draw_modes(axes, case, lambda chi: np.linalg.norm(chi[:, 1:], axis=1))
    axes.set_ylabel(r"$\|\chi_{k\neq k_1}\|$")
    axes.set_ylim(bottom=0)


def draw_mode_errors(axes: Axes, case: CaseRuns) -> None:
    """Magnitude of the relative error of |χ_k1| at the last events with respect to γ, on a logarithmic axis.

    Raises:
        ReportError: if χ is undefined, because there is no Δ_crit.
    """
    gamma = case.prediction.gamma
    if gamma is None or case.prediction.V_inv is None:
        raise ReportError(f"case {case.name!r}: χ and γ are undefined without Δ_crit")
    start, end = latter_part(case.last.simulation, SHOWN_MODES)
    for plant, result in case.runs.items():
        events = result.simulation.events
        late = is_between(events.t, start, end)
        chi = modes(result, reduce_state(result, events.x[late], events.x_o[late], events.x_h[late]))[:, 0]
        error = np.maximum(np.abs(np.abs(chi) / gamma - 1), LEAST_ERROR)
        axes.plot(events.t[late], error, linestyle="none", label=style.NAME[plant], **style.MARK[plant])
    style.residual(axes, "rel. error")
    axes.set(xlim=(start, end), xlabel="$t$ (s)")


def draw_norm(axes: Axes, case: CaseRuns) -> None:
    """The norm of x̄ on a logarithmic scale, events dotted; it is drawn if χ is undefined."""
    style.event_lines(axes, case.last.simulation.events.t)
    for plant, result in case.runs.items():
        simulation = result.simulation
        norm = np.linalg.norm(reduce_state(result, simulation.x, simulation.x_o, simulation.x_h), axis=1)
        axes.semilogy(simulation.t, np.maximum(norm, 1e-300), label=style.NAME[plant], **style.RUN[plant])
    axes.set(xlim=(0, float(case.last.simulation.t[-1])), xlabel="$t$ (s)", ylabel=r"$\|\bar{x}\|$  ($\chi$ undefined)")


def _draw_modes(axes: Axes, case: CaseRuns, part: Callable[[NDArray[np.complex128]], Array]) -> None:
    """A part of χ, shape (N, n + n̂) → (N,), for the latter part of every run."""
    if case.prediction.V_inv is None:
        raise ReportError(f"case {case.name!r}: χ is undefined without Δ_crit; draw the norm of x̄ instead")
    top = case.last
    start, end = latter_part(top.simulation, SHOWN_MODES)
    events = top.simulation.events.t
    style.event_lines(axes, events[is_between(events, start, end)])
    laid = lay_orbit(top) if case.prediction.cycle else None
    if laid is not None:
        t = laid.times(start, end)
        axes.plot(t, part(modes(top, laid.at(t, laid.reduced))), label="predicted", **style.PREDICTED)
    for plant, result in case.runs.items():
        simulation = result.simulation
        late = is_between(simulation.t, start, end)
        chi = modes(result, reduce_state(result, simulation.x[late], simulation.x_o[late], simulation.x_h[late]))
        axes.plot(simulation.t[late], part(chi), label=style.NAME[plant], **style.RUN[plant])
    axes.locator_params(axis="y", nbins=4, steps=[1, 2, 5, 10])
    axes.set_xlim(start, end)
    axes.set_xlabel("$t$ (s)")
