"""Where the linear theory holds: the relative error of its interval over two things that vary."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.report.maps.grid import Grid, edges, even, grid, label
from icmj.result.swept import Swept

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEVELS = (1e-3, 1e-2, 1e-1)
_COLOURS = "cividis_r"  # dark is far off; the same for eyes that see no red
_LEAST, _MOST = -8.0, -0.5
# one column of what each region is, from what to tell by, hatching and legend
_REGIONS: tuple[tuple[str, str, str], ...] = (
    ("fell", "xxxx", "falls"),
    ("elsewhere", "////", "another motion"),
    ("open", "....", "not settled in time"),
)


def draw_validity(axes: Axes, swept: Swept, x: str, y: str, plant: str = "mujoco") -> Any:
    """|relative error of the interval| in colour, contours at 0.1, 1 and 10 %; regions without the cycle are hatched.

    Returns:
        The coloured mesh, for a colour bar.
    """
    from matplotlib.patches import Patch

    laid = grid(swept, x, y)
    what = regions(swept, laid, plant)
    error = np.abs(laid.lay(swept.numbers(f"{plant}_error")))
    error[(what != "cycle")] = np.nan
    logarithmic = even(laid.x), even(laid.y)
    cells = edges(laid.x, logarithmic[0]), edges(laid.y, logarithmic[1])
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
    axes.set(xlim=(cells[0][0], cells[0][-1]), ylim=(cells[1][0], cells[1][-1]), xlabel=label(x), ylabel=label(y))
    for way, scaled in zip((axes.set_xscale, axes.set_yscale), logarithmic, strict=True):
        if scaled:
            way("log")
    if handles:
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False)
    return mesh


def regions(swept: Swept, laid: Grid, plant: str) -> Any:
    """The result at each point: cycle (the predicted one), elsewhere, fell, open; nothing if it is not finished."""
    outcome, kind = swept.texts(f"{plant}_outcome"), swept.texts(f"{plant}_kind")
    predicted = swept.texts(f"{plant}_on_predicted")
    told = np.array([_told(*each) for each in zip(outcome, kind, predicted, strict=True)] + ["nothing"])
    return told[laid.row]


def _told(outcome: str | None, kind: str | None, predicted: bool | None) -> str:
    if outcome is None:
        return "nothing"
    if outcome in ("fell", "diverged"):
        return "fell"
    if predicted:
        return "cycle"
    return "open" if kind in ("too short", "no events") else "elsewhere"


def hatch(axes: Axes, cells: tuple[Array, Array], inside: Any, pattern: str) -> None:
    """One hatched face around all cells that are inside, so that their seams are not seen."""
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


def _contours(axes: Axes, laid: Grid, size: Array) -> None:
    if np.isfinite(size).sum() < 4:
        return
    levels = [np.log10(level) for level in LEVELS]
    inside = np.ma.masked_invalid(size)
    lines = axes.contour(laid.x, laid.y, inside, levels=levels, colors="#111111", linewidths=0.8, linestyles="solid")
    axes.clabel(lines, fmt={at: f"{100 * level:g} %" for at, level in zip(levels, LEVELS, strict=True)}, fontsize=7)
