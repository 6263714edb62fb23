"""Panels (a) and (b): the eigenvalues of φ(Δ_ol), their largest magnitude and their loci."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.linear_plant import Array
from icmj.report import style
from icmj.report.pairing import CaseRuns
from icmj.theory.prediction import Locus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHADES = 14  # steps of the colour scale of Δ_ol along a locus
REACH = 1.3  # half height of panel (b): the unit circle and its surroundings


def modulus_panel(case: CaseRuns) -> Figure:
    """(a) Largest |λ| of φ against Δ_ol for ρ = 0 and ρ = 1, and the growth measured under the clock."""
    prediction = case.prediction
    figure, (axes,) = style.new_figure()
    axes.axhline(1, **style.CRITICAL)
    axes.plot(prediction.locus.delta, prediction.locus.largest, label=r"$\rho=1$", **style.ACTUAL)
    axes.plot(prediction.locus_exact.delta, prediction.locus_exact.largest, label=r"$\rho=0$", **style.EXACT)
    for plant, result in case.runs.items():
        if result.growth is not None:
            axes.plot(
                result.growth.delta,
                result.growth.measured,
                linestyle="none",
                label=f"measured, {style.NAME[plant]}",
                **style.MARK[plant],
            )
    end = float(prediction.locus.delta[-1])
    top = 1.6
    if prediction.delta_crit is not None:
        axes.axvline(prediction.delta_crit, **style.CRITICAL)
        right = prediction.delta_crit > 0.8 * end
        axes.annotate(
            rf"$\Delta_{{crit}}={prediction.delta_crit:.4g}$ s",
            (prediction.delta_crit, 0.06),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-3 if right else 3, 0),
            textcoords="offset points",
            ha="right" if right else "left",
        )
    else:
        largest = float(prediction.locus.largest.max())
        top = max(1.15, min(1.6, 1.1 * largest))
    axes.set(xlim=(0, end), ylim=(0, top), xlabel=r"$\Delta_{ol}$ (s)", ylabel=r"$\max_j\,|\lambda_j(\varphi)|$")
    style.letter(figure, "(a)")
    style.legend(figure, axes)
    return figure


def locus_panel(case: CaseRuns) -> Figure:
    """(b) Eigenvalues of φ in the complex plane as Δ_ol grows, about the unit circle."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, ListedColormap

    prediction = case.prediction
    locus = prediction.locus
    figure, (axes,) = style.new_figure()
    box = axes.get_position()
    axes.set_position((box.x0, box.y0, box.width * 0.84, box.height))
    colours = _shades()
    chunks = np.array_split(np.arange(len(locus.delta)), SHADES)
    for branch in locus.eigenvalues.T:
        for chunk, colour in zip(chunks, colours, strict=True):
            part = branch[chunk[0] : chunk[-1] + 2]
            part = np.where(np.maximum(abs(part.real), abs(part.imag)) < 4, part, np.nan)
            if np.isfinite(part).any():
                axes.plot(part.real, part.imag, color=colour, linewidth=1.2)
        _arrow(axes, branch, colours, chunks)
    angle = np.linspace(0, 2 * np.pi, 181)
    axes.plot(np.cos(angle), np.sin(angle), color="#333333", linewidth=0.6, zorder=1)
    axes.axhline(0, color="#cccccc", linewidth=0.4, zorder=0)
    axes.axvline(0, color="#cccccc", linewidth=0.4, zorder=0)
    if prediction.delta_crit is not None and prediction.eigenvalue is not None:
        at = eigenvalues_at(locus, prediction.delta_crit)
        axes.plot(
            at.real, at.imag, "o", markersize=3.6, markerfacecolor="white", markeredgecolor="#222222", linestyle="none",
            markeredgewidth=0.8, label=r"all $\lambda_j$ at $\Delta_{crit}$",
        )  # fmt: skip
        critical = prediction.eigenvalue
        axes.plot(
            critical.real, critical.imag, "D", markersize=5, markerfacecolor="#d55e00", markeredgecolor="white",
            markeredgewidth=0.6, linestyle="none", label=rf"$\lambda_{{crit}}={critical.real:+.0f}$", zorder=5,
        )  # fmt: skip
    width, height = axes.get_window_extent().size
    reach = REACH * width / height
    axes.set(
        xlim=(-reach, reach), ylim=(-REACH, REACH), xlabel=r"$\mathrm{Re}\,\lambda$", ylabel=r"$\mathrm{Im}\,\lambda$"
    )
    axes.set_xticks([-1, 0, 1])
    axes.set_yticks([-1, 0, 1])
    bar = figure.add_axes((box.x0 + box.width * 0.875, box.y0, box.width * 0.03, box.height))
    norm = BoundaryNorm(np.linspace(locus.delta[0], locus.delta[-1], SHADES + 1), SHADES)
    scale = figure.colorbar(ScalarMappable(norm, ListedColormap(colours)), cax=bar)
    from matplotlib.ticker import MaxNLocator

    ticks = MaxNLocator(4).tick_values(float(locus.delta[0]), float(locus.delta[-1]))
    scale.set_ticks([tick for tick in ticks if locus.delta[0] <= tick <= locus.delta[-1]])
    scale.ax.tick_params(which="minor", length=0)
    scale.ax.minorticks_off()
    scale.outline.set_linewidth(0.4)
    scale.set_label(r"$\Delta_{ol}$ (s)", labelpad=2)
    style.letter(figure, "(b)")
    style.legend(figure, axes)
    return figure


def eigenvalues_at(locus: Locus, delta: float) -> Array:
    """Eigenvalues at Δ, interpolated along each branch; complex, shape (n + n̂,)."""
    return np.array([np.interp(delta, locus.delta, branch) for branch in locus.eigenvalues.T])


def _shades() -> list[tuple[float, float, float, float]]:
    from matplotlib import colormaps

    return [tuple(colour) for colour in colormaps["cividis"](np.linspace(0.92, 0.0, SHADES))]


def _arrow(axes: Axes, branch: Array, colours: list[tuple[float, float, float, float]], chunks: list[Array]) -> None:
    """A head on the branch where it runs longest in view, pointing to growing Δ."""
    step = np.abs(np.diff(branch))
    seen = (np.abs(branch.imag[:-1]) < REACH) & (np.abs(branch.real[:-1]) < 1.5 * REACH) & (step < 0.5)
    if not seen.any() or step[seen].sum() < 0.15:
        return
    travelled = np.cumsum(np.where(seen, step, 0))
    i = int(np.searchsorted(travelled, 0.5 * travelled[-1]))
    direction = branch[i + 1] - branch[i]
    if abs(direction) == 0:
        return
    head = branch[i] + 0.02 * direction / abs(direction)
    shade = next(n for n, chunk in enumerate(chunks) if i <= chunk[-1])
    axes.annotate(
        "",
        (head.real, head.imag),
        (branch[i].real, branch[i].imag),
        arrowprops={
            "arrowstyle": "-|>",
            "color": colours[shade],
            "lw": 0.8,
            "mutation_scale": 6.5,
            "shrinkA": 0,
            "shrinkB": 0,
        },
    )
