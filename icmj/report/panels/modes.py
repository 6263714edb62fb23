"""Panel (f): the eigendecomposition χ of x̄ for the latter part of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.plant.linear_plant import transformation
from icmj.report import style
from icmj.report.pairing import CaseRuns
from icmj.report.panels.window import latter_part, repeated_orbit
from icmj.result.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INTERVALS = 6


def mode_panel(case: CaseRuns) -> Figure:
    """(f) χ_k1 and the norm of the other elements of χ against time, events and ±γ dotted.

    Where χ is undefined (no Δ_crit), the norm of x̄ is drawn instead.
    """
    if case.prediction.V_inv is None:
        return _norm_panel(case)
    figure, (critical, others) = style.new_figure(rows=2)
    top = case.last
    start, end = latter_part(top, INTERVALS)
    for axes in (critical, others):
        events = top.simulation.events.t
        style.event_lines(axes, events[(events >= start) & (events <= end)])
    orbit = case.prediction.orbit
    if orbit is not None and case.prediction.cycle and len(top.simulation.events):
        n = top.actual.n
        x_bar = orbit.X[:, : n + top.assumed.n]
        t, signal = repeated_orbit(top, _chi(top, x_bar), start, end)
        critical.plot(t, signal[:, 0].real, label="predicted", **style.PREDICTED)
        others.plot(t, np.linalg.norm(signal[:, 1:], axis=1), **style.PREDICTED)
    for plant, result in case.runs.items():
        simulation = result.simulation
        late = (simulation.t >= start) & (simulation.t <= end)
        chi = _chi(result, x_bar_of(result)[late])
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
    style.letter(figure, "(f)")
    style.legend(figure, critical)
    return figure


def x_bar_of(result: Result) -> Array:
    """x̄ = (x, x_o − T̂x) of a run, shape (N, n + n̂)."""
    T_hat = transformation(result.assumed, result.actual)
    simulation = result.simulation
    return np.hstack([simulation.x, simulation.x_o - simulation.x @ T_hat.T])


def _chi(result: Result, x_bar: Array) -> NDArray[np.complex128]:
    """χ = V⁻¹x̄ (eq. chi), complex, shape (N, n + n̂)."""
    V_inv = result.prediction.V_inv
    assert V_inv is not None
    return x_bar @ V_inv.T


def _norm_panel(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    style.event_lines(axes, case.last.simulation.events.t)
    for plant, result in case.runs.items():
        norm = np.linalg.norm(x_bar_of(result), axis=1)
        axes.semilogy(result.simulation.t, np.maximum(norm, 1e-300), label=style.NAME[plant], **style.RUN[plant])
    axes.set(xlim=(0, float(case.last.simulation.t[-1])), xlabel="$t$ (s)", ylabel=r"$\|\bar{x}\|$  ($\chi$ undefined)")
    style.letter(figure, "(f)")
    style.legend(figure, axes)
    return figure
