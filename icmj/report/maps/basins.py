"""Basins of attraction: the motion reached from each initial state."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.text import one_line
from icmj.report.maps.grid import edges, grid, label
from icmj.result.swept import Swept

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe-Ito, from the most frequent motion on; what comes after them is one grey
_COLOURS = ("#56b4e9", "#e69f00", "#009e73", "#f0e442", "#0072b2", "#cc79a7", "#d55e00")
_OTHERS = "#bbbbbb"
_SAME = 1e-3  # relative: intervals that are closer than this are of one cycle


def draw_basins(axes: Axes, swept: Swept, x: str, y: str, plant: str = "linear") -> None:
    """Every initial state in the colour of the motion that it leads to; the most frequent come first in the legend."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    laid = grid(swept, x, y)
    names = motions(swept, plant)
    frequent = [name for name, _ in Counter(name for name in names if name).most_common()]
    shown = frequent[: len(_COLOURS)]
    number = {name: i if i < len(_COLOURS) else len(_COLOURS) for i, name in enumerate(frequent)}
    values = laid.lay(np.array([number.get(name, np.nan) for name in names], float))
    axes.pcolormesh(
        edges(laid.x), edges(laid.y), values, cmap=ListedColormap([*_COLOURS, _OTHERS]),
        vmin=-0.5, vmax=len(_COLOURS) + 0.5, rasterized=True,
    )  # fmt: skip
    handles = [Patch(facecolor=colour, label=name) for name, colour in zip(shown, _COLOURS, strict=False)]
    if len(frequent) > len(shown):
        handles.append(Patch(facecolor=_OTHERS, label=f"{len(frequent) - len(shown)} others"))
    axes.set(xlabel=label(x), ylabel=label(y))
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False)


def motions(swept: Swept, plant: str) -> list[str]:
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
