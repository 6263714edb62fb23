"""How large a body sways under a controller that is not intermittent, over one or two things that vary."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.errors import ReportError
from icmj.report import style
from icmj.report.maps.grid import edges, even, grid, label
from icmj.report.maps.validity import hatch
from icmj.result.swept import Swept

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_sway(axes: Axes, swept: Swept, x: str, y: str, plant: str = "linear") -> Any:
    """The first output's standard deviation in colour, hatched where the run falls, the limit of the continuous loop.

    Returns:
        The coloured mesh, for a colour bar.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    laid = grid(swept, x, y)
    size, root = laid.lay(swept.numbers(swayed(swept, plant))), laid.lay(swept.numbers("root_real"))
    fell = np.array([outcome in ("fell", "diverged") for outcome in swept.texts(f"{plant}_outcome")] + [False])[
        laid.row
    ]
    logarithmic = even(laid.x), even(laid.y)
    cells = edges(laid.x, logarithmic[0]), edges(laid.y, logarithmic[1])
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
    for way, scaled in zip((axes.set_xscale, axes.set_yscale), logarithmic, strict=True):
        if scaled:
            way("log")
    axes.set(xlim=(cells[0][0], cells[0][-1]), ylim=(cells[1][0], cells[1][-1]), xlabel=label(x), ylabel=label(y))
    if handles:
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False)
    return mesh


def draw_sway_curve(axes: Axes, swept: Swept, x: str) -> None:
    """The first output's standard deviation on each plant that was simulated, where the run did not fall."""
    at = swept.numbers(x)
    order = np.argsort(at)
    for plant in ("linear", "mujoco"):
        if f"{plant}_outcome" in swept.table.column_names:
            stood = np.array([outcome == "completed" for outcome in swept.texts(f"{plant}_outcome")])
            size = np.where(stood, swept.numbers(swayed(swept, plant)), np.nan)
            look = {**style.MARK[plant], "linestyle": "none", "markersize": 3.4 if plant == "linear" else 3.0}
            axes.plot(at[order], size[order], label=style.NAME[plant], **look)
    axes.set(xlabel=label(x), ylabel=f"RMS of {_output(swept)}", xlim=(at.min(), at.max()))
    axes.set_ylim(bottom=0)


def swayed(swept: Swept, plant: str) -> str:
    """The column of the first output's standard deviation.

    Raises:
        ReportError: if it is not there.
    """
    for name in swept.table.column_names:
        if name.startswith(f"{plant}_rms_"):
            return str(name)
    raise ReportError(f"sweep {swept.name!r} has no motion on the {plant} plant; ask for it ([ask] motion)")


def _output(swept: Swept) -> str:
    names = (name for name in swept.table.column_names if "_rms_" in name)
    return str(next(names, "the output")).partition("_rms_")[2]
