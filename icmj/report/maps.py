"""Pictures of sweeps, each drawn into axes from the rows alone.

Rows of a sweep laid on the grid that they were computed on.

The critical interval against one varied field, with the measured intervals.

Maps over two things that vary: where the linear theory holds, how large a body sways, basins of attraction.

The figures of a sweep, selected by the varied fields and the requested columns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.case.quantity import in_unit
from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError
from icmj.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 20_000_000  # cells of a map


@dataclass(frozen=True, eq=False)
class MapGrid:
    """Two things that vary, every value of the one with every value of the other.

    Attributes:
        x, y: their values, rising, shapes (m,) and (n,).
        row: which row of the table stands at (y, x), shape (n, m); −1 where none is finished.
    """

    x: Array
    y: Array
    row: NDArray[np.int64]

    def lay(self, values: Array) -> Array:
        """A column on the grid, NaN where no point is finished; shape (n, m)."""
        return np.where(self.row >= 0, np.append(values, np.nan)[self.row], np.nan)

    @property
    def cells(self) -> tuple[Array, Array]:
        """Edges of the cells around x and y, shapes (m + 1,) and (n + 1,)."""
        return edges(self.x, even(self.x)), edges(self.y, even(self.y))

    def frame(self, axes: Axes, swept: SweepTable, x: str, y: str) -> None:
        """Fit limits, labels and scales of axes to the cells."""
        (left, *_, right), (low, *_, high) = self.cells
        axes.set(xlim=(left, right), ylim=(low, high), xlabel=label(x, swept), ylabel=label(y, swept))
        for way, values in ((axes.set_xscale, self.x), (axes.set_yscale, self.y)):
            if even(values):
                way("log")


def grid(swept: SweepTable, x: str, y: str) -> MapGrid:
    """The grid of two columns.

    Raises:
        ReportError: if a column is not there or not of numbers, or the points are not on a grid.
    """
    try:
        columns = [swept.numbers(name) for name in (x, y)]
    except (TypeError, ValueError) as error:
        raise ReportError(f"sweep {swept.name!r}: {x} and {y} are not both numbers") from error
    (xs, i), (ys, j) = (np.unique(column, return_inverse=True) for column in columns)
    if len(xs) * len(ys) > min(max(swept.points, 1), MOST) or len(xs) < 2 or len(ys) < 2:
        raise ReportError(f"sweep {swept.name!r}: {x} and {y} are not on a grid; give both of them low, high and count")
    row = np.full((len(ys), len(xs)), -1)
    row[j, i] = np.arange(len(i))
    return MapGrid(xs, ys, row)


def edges(values: Array, logarithmic: bool = False) -> Array:
    """Edges of the cells around values, half way between them; shape (m + 1,)."""
    at = np.log(values) if logarithmic else values
    middle = (at[1:] + at[:-1]) / 2
    found = np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])
    return np.exp(found) if logarithmic else found


def even(values: Array) -> bool:
    """Whether values are spaced by equal ratios, not by equal differences."""
    return bool(values[0] > 0 and len(values) > 2 and values[-1] / values[0] > 20)


def label(name: str, swept: SweepTable) -> str:
    """A column's name as the paper writes it, single letters slanted, with its unit where the sweep knows it."""
    letter, _, index = name.partition("_")
    words = name.replace("$", r"\$")
    if len(letter) == 1 and len(index) <= 4 and (letter + index).isalnum():
        words = f"${letter}_{{{index}}}$" if index else f"${letter}$"
    unit = swept.units.get(name, "")
    return f"{words} ({unit})" if unit else words


_SIGN = {1.0: ("#0072b2", "λ = +1"), -1.0: ("#d55e00", "λ = −1")}


def draw_curve(axes: Axes, swept: SweepTable, x: str) -> None:
    """Δ_crit as predicted, solid where a cycle is, dashed where none is; measured intervals; rings: repelling cycles.

    Raises:
        ReportError: if the column is not there or not of numbers.
    """
    if x not in swept.table.column_names:
        raise ReportError(f"sweep {swept.name!r} has no column {x!r}")
    at, crit, sign = swept.numbers(x), swept.numbers("predicted_delta_crit"), swept.numbers("predicted_eigenvalue")
    order = np.argsort(at)
    at, crit, sign = at[order], crit[order], sign[order]
    cycle = swept.numbers("predicted_cycle")[order] > 0
    for value, (colour, eigenvalue) in _SIGN.items():
        for there, line, words in ((cycle, "solid", rf"$\Delta_{{crit}}$, {eigenvalue}"), (~cycle, (0, (3, 2)), None)):
            shown = np.where((sign == value) & there, crit, np.nan)
            if np.isfinite(shown).any():
                axes.plot(at, shown, color=colour, linestyle=line, linewidth=1.6, label=words, zorder=2)
    for plant in ("linear", "mujoco"):
        if f"{plant}_interval" in swept.table.column_names:
            kind = np.array(swept.texts(f"{plant}_kind"))[order]
            measured = np.where(kind == "cycle", swept.numbers(f"{plant}_interval")[order], np.nan)
            look = {**style.MARK[plant], "linestyle": "none", "markersize": 3.4 if plant == "linear" else 3.0}
            axes.plot(at, measured, label=style.NAME[plant], zorder=3, **look)
        if f"{plant}_cycle_interval" in swept.table.column_names:
            repels = swept.numbers(f"{plant}_cycle_attracting")[order] == 0
            exact = np.where(repels, swept.numbers(f"{plant}_cycle_interval")[order], np.nan)
            if np.isfinite(exact).any():
                axes.plot(
                    at, exact, linestyle="none", marker="o", markersize=4.6, markerfacecolor="none",
                    markeredgecolor="#777777", markeredgewidth=0.7, label=f"{style.NAME[plant]}, repelling", zorder=2.5,
                )  # fmt: skip
    axes.set(xlabel=label(x, swept), ylabel=r"$\Delta_{ol}$ (s)", xlim=(at.min(), at.max()))
    axes.set_ylim(bottom=0)


LEVELS = (1e-3, 1e-2, 1e-1)
_COLOURS = "cividis_r"  # dark is far off; the same for eyes that see no red
_LEAST, _MOST = -8.0, -0.5
# of each region its name, hatching and legend
_REGIONS: tuple[tuple[str, str, str], ...] = (
    ("fell", "xxxx", "falls"),
    ("elsewhere", "////", "another motion"),
    ("open", "....", "not settled in time"),
)
# Okabe-Ito, from the most frequent motion on; what comes after them is one grey
_MOTIONS = ("#56b4e9", "#e69f00", "#009e73", "#f0e442", "#0072b2", "#cc79a7", "#d55e00")
_OTHERS = "#bbbbbb"
_SAME = 1e-3  # relative: intervals that are closer than this are of one cycle


def choose_plant(swept: SweepTable, asked: str | None, *order: str) -> str:
    """The plant whose motion is drawn: the one that is asked for, else the first of an order that was simulated.

    Raises:
        ReportError: if it was not simulated.
    """
    there = [plant for plant in ("linear", "mujoco") if f"{plant}_outcome" in swept.table.column_names]
    found = asked or next((plant for plant in order if plant in there), order[0])
    if found not in there:
        also = f"; there is motion on the {there[0]} plant" if there else "; ask for it ([ask] motion)"
        raise ReportError(f"sweep {swept.name!r} has no motion on the {one_line(found, 40)} plant{also}")
    return found


def draw_validity(axes: Axes, swept: SweepTable, x: str, y: str, plant: str | None = None) -> Any:
    """|relative error of the interval| in colour, contours at 0.1, 1 and 10 %; regions without the cycle are hatched.

    Returns:
        The coloured mesh, for a colour bar.
    """
    from matplotlib.patches import Patch

    laid, plant = grid(swept, x, y), choose_plant(swept, plant, "mujoco", "linear")
    what = regions(swept, laid, plant)
    error = np.abs(laid.lay(swept.numbers(f"{plant}_error")))
    error[(what != "cycle")] = np.nan
    cells = laid.cells
    with np.errstate(divide="ignore"):
        size = np.log10(np.where(error > 0, error, np.nan))
    axes.set_facecolor("white")
    mesh = axes.pcolormesh(*cells, size, cmap=_COLOURS, vmin=_LEAST, vmax=_MOST, rasterized=True)
    handles = []
    for name, pattern, words in _REGIONS:
        inside = what == name
        if inside.any():
            hatch(axes, cells, inside, pattern)
            handles.append(Patch(facecolor="white", edgecolor="#777777", hatch=pattern, linewidth=0.4, label=words))
    _contours(axes, laid, size)
    laid.frame(axes, swept, x, y)
    if handles:
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False)
    return mesh


def regions(swept: SweepTable, laid: MapGrid, plant: str) -> Any:
    """The result at each point: cycle (the predicted one), elsewhere, fell, open; nothing if it is not finished."""
    outcome, kind = swept.texts(f"{plant}_outcome"), swept.texts(f"{plant}_kind")
    predicted = swept.texts(f"{plant}_on_predicted")
    ends = np.array([_end_of(*each) for each in zip(outcome, kind, predicted, strict=True)] + ["nothing"])
    return ends[laid.row]


def _end_of(outcome: str | None, kind: str | None, predicted: bool | None) -> str:
    if outcome is None:
        return "nothing"
    if outcome in ("fell", "diverged"):
        return "fell"
    if predicted:
        return "cycle"
    return "open" if kind in ("too short", "no events") else "elsewhere"


def hatch(axes: Axes, cells: tuple[Array, Array], inside: Any, pattern: str) -> None:
    """One hatched face around all cells that are inside, so that their seams do not show."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    x, y = cells
    vertices, codes = [], []
    for j, i in zip(*np.nonzero(inside), strict=True):
        vertices += [(x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1]), (x[i], y[j])]
        codes += [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    axes.add_collection(
        PathCollection([Path(vertices, codes)], facecolor="white", edgecolor="#999999", hatch=pattern, linewidth=0.0)
    )


def _contours(axes: Axes, laid: MapGrid, size: Array) -> None:
    if np.isfinite(size).sum() < 4:
        return
    levels = [np.log10(level) for level in LEVELS]
    inside = np.ma.masked_invalid(size)
    from matplotlib.patheffects import withStroke

    # with white edges, because the map is dark where the error is large, and labels upright on a white ground
    lines = axes.contour(laid.x, laid.y, inside, levels=levels, colors="#111111", linewidths=0.8, linestyles="solid")
    lines.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    words = {at: f"{100 * level:g} %" for at, level in zip(levels, LEVELS, strict=True)}
    for text in axes.clabel(lines, fmt=words, fontsize=7.5):
        text.set_rotation(0)
        text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.8})


def draw_sway(axes: Axes, swept: SweepTable, x: str, y: str, plant: str | None = None) -> Any:
    """The first output's standard deviation in colour, hatched where the run falls, the limit of the continuous loop.

    Returns:
        The coloured mesh, for a colour bar.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    laid, plant = grid(swept, x, y), choose_plant(swept, plant, "linear", "mujoco")
    size, root = laid.lay(swept.numbers(sway_column(swept, plant))), laid.lay(swept.numbers("root_real"))
    fell = np.array([outcome in ("fell", "diverged") for outcome in swept.texts(f"{plant}_outcome")] + [False])[
        laid.row
    ]
    cells = laid.cells
    axes.set_facecolor("white")
    with np.errstate(divide="ignore"):
        shown = np.log10(np.where((size > 0) & ~fell, size, np.nan))
    mesh = axes.pcolormesh(*cells, shown, cmap="cividis", rasterized=True)
    handles: list[Any] = []
    if fell.any():
        hatch(axes, cells, fell, "xxxx")
        handles.append(Patch(facecolor="white", edgecolor="#777777", hatch="xxxx", linewidth=0.4, label="falls"))
    if (root > 0).any() and (root < 0).any():
        axes.contour(laid.x, laid.y, np.ma.masked_invalid(root), levels=[0.0], colors="#d55e00", linewidths=1.4)
        handles.append(Line2D([], [], color="#d55e00", linewidth=1.4, label="limit of stability, feedback always on"))
    laid.frame(axes, swept, x, y)
    if handles:
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False)
    return mesh


def draw_sway_curve(axes: Axes, swept: SweepTable, x: str) -> None:
    """The first output's standard deviation on each plant that was simulated, where the run did not fall."""
    at = swept.numbers(x)
    order = np.argsort(at)
    for plant in ("linear", "mujoco"):
        if f"{plant}_outcome" in swept.table.column_names:
            stood = np.array([outcome == "completed" for outcome in swept.texts(f"{plant}_outcome")])
            size = np.where(stood, swept.numbers(sway_column(swept, plant)), np.nan)
            look = {**style.MARK[plant], "linestyle": "none", "markersize": 3.4 if plant == "linear" else 3.0}
            axes.plot(at[order], size[order], label=style.NAME[plant], **look)
    output = _output(swept)
    rms = in_unit(f"RMS of {output}", swept.units.get(output, ""))
    axes.set(xlabel=label(x, swept), ylabel=rms, xlim=(at.min(), at.max()))
    axes.set_ylim(bottom=0)


def sway_column(swept: SweepTable, plant: str) -> str:
    """The column of the first output's standard deviation.

    Raises:
        ReportError: if it is not there.
    """
    for name in swept.table.column_names:
        if name.startswith(f"{plant}_rms_"):
            return str(name)
    raise ReportError(f"sweep {swept.name!r} has no motion on the {plant} plant; ask for it ([ask] motion)")


def _output(swept: SweepTable) -> str:
    names = (name for name in swept.table.column_names if "_rms_" in name)
    return str(next(names, "the output")).partition("_rms_")[2]


def draw_basins(axes: Axes, swept: SweepTable, x: str, y: str, plant: str | None = None) -> None:
    """Every initial state in the colour of the motion that it leads to; the most frequent come first in the legend."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    laid, plant = grid(swept, x, y), choose_plant(swept, plant, "linear", "mujoco")
    names = motions(swept, plant)
    frequent = [name for name, _ in Counter(name for name in names if name).most_common()]
    shown = frequent[: len(_MOTIONS)]
    number = {name: i if i < len(_MOTIONS) else len(_MOTIONS) for i, name in enumerate(frequent)}
    values = laid.lay(np.array([number.get(name, np.nan) for name in names], float))
    axes.pcolormesh(
        edges(laid.x), edges(laid.y), values, cmap=ListedColormap([*_MOTIONS, _OTHERS]),
        vmin=-0.5, vmax=len(_MOTIONS) + 0.5, rasterized=True,
    )  # fmt: skip
    handles = [Patch(facecolor=colour, label=name) for name, colour in zip(shown, _MOTIONS, strict=False)]
    if len(frequent) > len(shown):
        handles.append(Patch(facecolor=_OTHERS, label=f"{len(frequent) - len(shown)} others"))
    axes.set(xlabel=label(x, swept), ylabel=label(y, swept))
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False)


def motions(swept: SweepTable, plant: str) -> list[str]:
    """The motion of every row in few words; cycles whose intervals agree are one."""
    columns = zip(
        *(swept.texts(f"{plant}_{name}") for name in ("kind", "p", "mirrored", "interval", "outcome")), strict=True
    )
    known: list[tuple[Any, ...]] = []
    found = []
    for kind, p, mirrored, interval, outcome in columns:
        if kind is None:
            found.append("")
        elif outcome in ("fell", "diverged"):
            found.append("falls")
        elif kind != "cycle":
            found.append(one_line(kind))
        else:
            same = (each for each in known if each[:2] == (p, mirrored) and abs(each[2] / interval - 1) < _SAME)
            first = next(same, None)
            if first is None:
                known.append(first := (p, mirrored, interval))
            events = "1 event" if p == 1 else f"{p} events"
            found.append(f"{'mirrored ' if mirrored else ''}cycle of {events}, {first[2]:.3g} s")
    return found


_WIDE = 130.0  # mm


@dataclass(frozen=True, eq=False)
class SweptPicture:
    """One figure of a sweep: the end of its file name, the figure, and its caption."""

    name: str
    figure: Figure
    caption: str


def pictures(swept: SweepTable) -> Iterator[SweptPicture]:
    """All that can be drawn of a sweep: a map of validity, basins, a curve of Δ_crit, or the size of the sway."""
    numeric = [(name, field) for name, field in swept.varies if _varies(swept, name)]
    plants = [plant for plant in ("linear", "mujoco") if f"{plant}_kind" in swept.table.column_names]
    starts = [name for name, field in numeric if field.startswith(("simulation.initial", "simulation.observer"))]
    if "root_real" in swept.table.column_names:  # a controller without a critical interval
        yield from _draw_sizes(swept, [name for name, _ in numeric])
        return
    if len(numeric) == 1:
        (name, _), *_ = numeric
        figure, (axes,) = style.new_figure(70.0, width=_WIDE)
        draw_curve(axes, swept, name)
        style.legend(figure, axes, columns=5)
        caption = (
            f"Critical interval against {name}: solid where a cycle is predicted, dashed where none is. Marks: "
            f"intervals of the cycles on which the runs settled.{_rings(swept)}"
        )
        yield SweptPicture("delta_crit", figure, caption)
    if len(numeric) != 2:
        return
    (x, _), (y, _) = numeric
    for plant in plants:
        try:
            if len(starts) == 2:
                figure, (axes,) = style.new_figure(95.0, width=_WIDE)
                _below_the_legend(figure)
                draw_basins(axes, swept, x, y, plant)
                caption = f"The motion to which each initial state leads, {_plant(plant)}."
                yield SweptPicture(f"basins_{plant}", figure, caption)
            else:
                yield SweptPicture(f"validity_{plant}", _validity(swept, x, y, plant), _caption(plant))
        except ReportError:  # not on a grid, so there is no map of it
            return


def _draw_sizes(swept: SweepTable, names: list[str]) -> Iterator[SweptPicture]:
    """The size of the sway over one or two things that vary."""
    plants = [plant for plant in ("linear", "mujoco") if f"{plant}_outcome" in swept.table.column_names]
    if len(names) == 1 and plants:
        figure, (axes,) = style.new_figure(70.0, width=_WIDE)
        draw_sway_curve(axes, swept, names[0])
        style.legend(figure, axes, columns=2)
        yield SweptPicture("sway", figure, "Standard deviation of the first output, in the second half of each run.")
    for plant in plants if len(names) == 2 else ():
        figure, (axes,) = style.new_figure(80.0, width=_WIDE)
        _below_the_legend(figure)
        try:
            bar = figure.colorbar(draw_sway(axes, swept, names[0], names[1], plant), ax=axes, pad=0.02)
        except ReportError:  # not on a grid, so there is no map of it
            return
        bar.set_label(r"$\log_{10}$ of the first output’s standard deviation")
        caption = f"Size of the sway in the second half of each run, {_plant(plant)}. Hatched: it falls."
        yield SweptPicture(f"sway_{plant}", figure, caption)


def _validity(swept: SweepTable, x: str, y: str, plant: str) -> Figure:
    figure, (axes,) = style.new_figure(80.0, width=_WIDE)
    _below_the_legend(figure)
    mesh = draw_validity(axes, swept, x, y, plant)
    bar = figure.colorbar(mesh, ax=axes, ticks=range(-8, 0), pad=0.02)
    bar.ax.set_yticklabels([rf"$10^{{{tick}}}$" for tick in range(-8, 0)])
    bar.set_label("relative error of the interval")
    return figure


def _below_the_legend(figure: Figure) -> None:
    axes = figure.axes[0]
    box = axes.get_position()
    axes.set_position((box.x0, box.y0, box.width, box.height * 0.97))


def _plant(plant: str) -> str:
    return "linear plant" if plant == "linear" else style.NAME[plant]


def _rings(swept: SweepTable) -> str:
    """What rings are, where there are some."""
    names = [
        name for name in ("linear_cycle_attracting", "mujoco_cycle_attracting") if name in swept.table.column_names
    ]
    repelling = any((swept.numbers(name) == 0).any() for name in names)
    return " Rings: cycles that repel, on which no run settles." if repelling else ""


def _caption(plant: str) -> str:
    return (
        f"Relative error of the linear theory’s interval, {_plant(plant)}, with contours at 0.1, 1 and 10 %. "
        "Hatched: where the run fell, settled on another motion, or had not settled when it ended."
    )


def _varies(swept: SweepTable, name: str) -> bool:
    """Whether a column has numbers of which at least two differ."""
    try:
        return len(np.unique(swept.numbers(name))) > 1
    except (TypeError, ValueError):
        return False


__all__ = ["draw_basins", "draw_curve", "draw_sway", "draw_validity"]
