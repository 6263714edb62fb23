"""Figure of the intersection point of ground reaction forces over frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from icmj.base.array import Array
from icmj.experiments.recording import Finding
from icmj.report import style
from icmj.report.sway import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Shown(Protocol):
    """The result of one case on one plant."""

    @property
    def title(self) -> str: ...

    @property
    def plant(self) -> str: ...

    @property
    def finding(self) -> Finding | None: ...


LINE: Mapping[str, str] = {"linear": "-", "mujoco": "--", "recording": "-"}


def coloured(found: Sequence[Shown]) -> list[tuple[Shown, str, str]]:
    """The results, each with the colour of its case and its legend entry."""
    titles = list(dict.fromkeys(one.title for one in found))
    several = len({one.plant for one in found}) > 1
    return [
        (
            one,
            COLOURS[titles.index(one.title) % len(COLOURS)],
            f"{one.title}, {style.NAME[one.plant]}" if several else one.title,
        )
        for one in found
    ]


def intersection_figure(found: Sequence[Shown]) -> Figure:
    """z over the height of the centre of mass against frequency; dotted: that height, thin: theory."""
    figure, (axes,) = style.new_figure(75.0, width=140.0)
    ratios, lowest = True, 1.0
    for one, colour, words in coloured(found):
        if one.finding is None:
            continue
        curves = one.finding.curves
        f, ratio = curves["frequency (Hz)"], curves["z/h"]
        ratios = ratios and bool(np.isfinite(ratio).all())
        z = ratio if ratios else curves["z (m)"]
        by = _by(curves) if ratios else 1.0
        axes.semilogy(f, z, color=colour, linestyle=LINE[one.plant], linewidth=1.3, label=words)
        spread = curves["deviation (m)"] / by
        if np.isfinite(spread).all() and (spread > 0).any():
            axes.fill_between(f, np.maximum(z - spread, 1e-3), z + spread, color=colour, alpha=0.15, linewidth=0)
        if one.plant != "mujoco":
            axes.semilogy(f, curves["theory (m)"] / by, color="#222222", linewidth=0.6, zorder=3)
        lowest = min(lowest, float(z[np.isfinite(z) & (z > 0)].min(initial=1.0)))
    axes.set_ylim(bottom=0.6 * lowest)
    if ratios:
        axes.axhline(1.0, **style.CRITICAL)
    axes.set(xlabel="frequency (Hz)", ylabel="intersection point, $z/h$" if ratios else "intersection point (m)")
    axes.set_yticks([0.2, 0.5, 1, 2, 5], labels=["0.2", "0.5", "1", "2", "5"])
    axes.minorticks_off()
    if axes.get_legend_handles_labels()[0]:
        axes.legend()
    return figure


def _by(curves: Mapping[str, Array]) -> float:
    """The height of the centre of mass by which results are divided [m]."""
    good = curves["z/h"] != 0
    return float(np.median(curves["z (m)"][good] / curves["z/h"][good]))
