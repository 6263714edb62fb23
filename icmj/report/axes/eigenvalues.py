"""The eigenvalues of φ(Δ_ol) in axes: their largest magnitude against Δ_ol, and their loci."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from icmj.plant.linear_plant import LinearPlant
from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.theory.error_system import error_system
from icmj.theory.locus import Locus, follow_locus

if TYPE_CHECKING:
    from matplotlib.axes import Axes


Spectrum = NDArray[np.complex128]

POINTS = 512
SHADES = 14  # steps of the colour scale of Δ_ol along a locus
REACH = 1.3  # half height of panel (b): the unit circle and its surroundings


def draw_modulus(axes: Axes, case: CaseRuns) -> None:
    """(a) Largest |λ| of φ against Δ_ol for ρ = 0 and ρ = 1, and the growth measured under the clock."""
    prediction = case.prediction
    actual, exact = shown_locus(case, case.first.actual), shown_locus(case, case.first.assumed)
    axes.axhline(1, **style.CRITICAL)
    axes.plot(actual.delta, actual.largest, label=r"$\rho=1$", **style.ACTUAL)
    axes.plot(exact.delta, exact.largest, label=r"$\rho=0$", **style.EXACT)
    for plant, result in case.runs.items():
        if result.growth is not None:
            growth = result.growth
            axes.plot(growth.delta, growth.measured, linestyle="none", label=style.NAME[plant], **style.MARK[plant])
    if prediction.delta_crit is not None:
        axes.axvline(prediction.delta_crit, **style.CRITICAL)
        axes.annotate(
            rf"$\Delta_{{crit}}={prediction.delta_crit:.4g}$ s",
            (prediction.delta_crit, 0.93),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-4, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6},
        )
    top = max(1.15, min(1.6, 1.1 * float(actual.largest.max())))
    axes.set(xlim=(0, actual.delta[-1]), ylim=(0, top))
    axes.set(xlabel=r"$\Delta_{ol}$ (s)", ylabel=r"$\max_j\,|\lambda_j(\varphi)|$")


def draw_locus(axes: Axes, case: CaseRuns) -> None:
    """(b) Eigenvalues of φ in the complex plane as Δ_ol grows, about the unit circle."""
    prediction = case.prediction
    shown = shown_locus(case, case.first.actual)
    shades = _shades()
    chunks = np.array_split(np.arange(len(shown.delta)), SHADES)
    for branch in shown.eigenvalues.T:
        near = np.where(np.maximum(abs(branch.real), abs(branch.imag)) < 4, branch, np.nan)
        for chunk, shade in zip(chunks, shades, strict=True):
            part = near[chunk[0] : chunk[-1] + 2]
            if np.isfinite(part).any():
                axes.plot(part.real, part.imag, color=shade, linewidth=1.2)
        _arrow(axes, branch, shades, chunks)
    angle = np.linspace(0, 2 * np.pi, 181)
    axes.plot(np.cos(angle), np.sin(angle), color="#333333", linewidth=0.6, zorder=1)
    axes.axhline(0, color="#cccccc", linewidth=0.4, zorder=0)
    axes.axvline(0, color="#cccccc", linewidth=0.4, zorder=0)
    if prediction.delta_crit is not None and prediction.eigenvalue is not None:
        at = _eigenvalues_at(case, prediction.delta_crit)
        all_name, name = r"all $\lambda_j$ at $\Delta_{crit}$", rf"$\lambda_{{crit}}={prediction.eigenvalue.real:+.0f}$"
        axes.plot(at.real, at.imag, label=all_name, **style.EIGENVALUE)
        axes.plot(prediction.eigenvalue.real, prediction.eigenvalue.imag, label=name, **style.CRITICAL_EIGENVALUE)
    width, height = axes.get_window_extent().size
    axes.set(xlim=(-REACH * width / height, REACH * width / height), ylim=(-REACH, REACH))
    axes.set(xlabel=r"$\mathrm{Re}\,\lambda$", ylabel=r"$\mathrm{Im}\,\lambda$", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    axes.set_aspect("equal")  # whatever becomes of the figure


def shown_locus(case: CaseRuns, plant: LinearPlant) -> Locus:
    """The eigenvalues with ``plant`` in the loop, from Δ = 0 to somewhat beyond Δ_crit."""
    controller, end = case.controller, _last_interval(case)
    system = error_system(plant, controller.design, controller.hold, delay=controller.delay, match="position")
    found = follow_locus(system, end, points=POINTS)
    if controller.delay:
        return found  # from the delay on
    # φ(0) is the identity
    eigenvalues = np.vstack([np.ones((1, found.eigenvalues.shape[1])), found.eigenvalues])
    return Locus(np.append(0.0, found.delta), eigenvalues)


def _last_interval(case: CaseRuns) -> float:
    prediction = case.prediction
    if prediction.delta_crit is None:
        return prediction.delta_max
    return min(prediction.delta_max, 1.6 * prediction.delta_crit)


def _eigenvalues_at(case: CaseRuns, delta: float) -> Spectrum:
    controller = case.controller
    phi = error_system(
        case.first.actual, controller.design, controller.hold, delay=controller.delay, match="position"
    ).phi(delta)
    return np.linalg.eigvals(phi).astype(complex)


def _shades() -> list[tuple[float, ...]]:
    from matplotlib import colormaps

    return [tuple(shade) for shade in colormaps["cividis"](np.linspace(0.9, 0.0, SHADES))]


def draw_scale(bar: Axes, case: CaseRuns) -> None:
    """The colour scale of Δ_ol along the loci, in separate axes."""
    from matplotlib.ticker import MaxNLocator

    end = _last_interval(case)
    step = end / SHADES
    bar.bar(0, step * 1.02, width=1, bottom=step * np.arange(SHADES), color=_shades(), linewidth=0)
    bar.set(xlim=(-0.5, 0.5), ylim=(0, end), xticks=[])
    bar.set_ylabel(r"$\Delta_{ol}$ (s)", labelpad=2)
    bar.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    bar.yaxis.tick_right()
    bar.yaxis.set_label_position("right")
    bar.spines[:].set_visible(False)


def _arrow(axes: Axes, branch: Spectrum, shades: list[tuple[float, ...]], chunks: list[NDArray[Any]]) -> None:
    """An arrowhead half-way along the visible part of the branch, pointing to growing Δ."""
    step = np.abs(np.diff(branch))
    near = (np.abs(branch.imag[:-1]) < REACH) & (np.abs(branch.real[:-1]) < 1.3 * REACH) & (step < 0.3)
    travelled = np.cumsum(np.where(near, step, 0))
    if travelled[-1] < 0.25:
        return
    i = int(np.searchsorted(travelled, 0.5 * travelled[-1]))
    direction = branch[i + 1] - branch[i]
    head = branch[i] + 0.02 * direction / abs(direction)
    shade = shades[next(n for n, chunk in enumerate(chunks) if i <= chunk[-1])]
    look = {"arrowstyle": "-|>", "color": shade, "lw": 0.8, "mutation_scale": 6.5, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (head.real, head.imag), (branch[i].real, branch[i].imag), arrowprops=look)
