"""Maps over two things that vary: where the linear theory holds, how large a body sways, basins of attraction."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.case.quantity import in_unit
from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError
from icmj.report import style
from icmj.report.interval_curve import draw_curve
from icmj.report.map_grid import MapGrid, edges, grid, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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


__all__ = ["draw_basins", "draw_curve", "draw_sway", "draw_validity"]
