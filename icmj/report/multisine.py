"""Figure of a multi-sine experiment: gain and phase at the excited lines, and power at all lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.report import style
from icmj.report.intersection_point import Shown, coloured

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKER = {"linear": "o", "mujoco": "x", "recording": "o"}
LOWEST = 1e-6  # of the largest power; what is less is not drawn
LEGEND = 0.1  # of the height of the axes: a line of the legend


def multisine_figure(found: Sequence[Shown]) -> Figure:
    """Gain with 95 % confidence, phase, power; line: theory; bars to the ground: excited lines; points: the remnant."""
    figure, (gain, phase, power) = style.new_figure(150.0, rows=3, width=150.0)
    highest, ends = 0.0, (np.inf, 0.0)
    for one, colour, words in coloured(found):
        if one.finding is None:
            continue
        curves = one.finding.curves
        f, excited = curves["frequency (Hz)"], curves["excited"] > 0
        response = (curves["real"] + 1j * curves["imag"])[excited]
        marker, lines = MARKER[one.plant], f[excited]
        style_of: dict[str, Any] = {
            "color": colour,
            "marker": marker,
            "linestyle": "none",
            "markersize": 3.5,
            "fillstyle": "none",
        }
        gain.errorbar(lines, np.abs(response), curves["radius"][excited], elinewidth=0.6, label=words, **style_of)
        phase.plot(lines, np.degrees(np.angle(response)), **style_of)
        theory = (curves["theory, real"] + 1j * curves["theory, imag"])[excited]
        gain.plot(lines, np.abs(theory), color="#222222", linewidth=0.6)
        phase.plot(lines, np.degrees(np.angle(theory)), color="#222222", linewidth=0.6)
        values, ends = curves["power"], (min(ends[0], lines[0]), max(ends[1], lines[-1]))
        power.plot(f[~excited], values[~excited], color=colour, linestyle="none", marker=".", markersize=1, zorder=1)
        power.plot(lines, values[excited], **style_of)
        highest = max(highest, float(values.max(initial=0.0)))
    gain.set(xscale="log", yscale="log", ylabel="gain")
    phase.set(ylabel="phase (°)", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    power.set(yscale="log", ylabel="power", xlabel="frequency (Hz)")
    if highest > 0:
        power.set_xlim(ends[0] / 2, 2 * ends[1])
        power.set_ylim(bottom=LOWEST * highest, top=3 * highest)
    low, high = gain.get_ylim()
    rows = -(-len(gain.get_legend_handles_labels()[1]) // 2)
    gain.set_ylim(low, high * (high / low) ** (LEGEND * max(rows - 2, 0)))  # two fit above the axes
    style.legend(figure, gain, columns=2)
    return figure
