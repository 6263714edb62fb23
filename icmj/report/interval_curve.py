"""The critical interval against one varied field, with the measured intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.case.sweep_table import SweepTable
from icmj.errors import ReportError
from icmj.report import style
from icmj.report.map_grid import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
