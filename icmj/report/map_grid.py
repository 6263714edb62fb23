"""Rows of a sweep laid on the grid that they were computed on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
