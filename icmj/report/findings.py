"""Figures of what experiments find: intersection point of ground reaction forces, quiet standing, multi-sines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from icmj.base.array import Array
from icmj.experiments.quiet_standing import Standing
from icmj.experiments.recording import Finding
from icmj.report import style
from icmj.report.sway import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKER = {"linear": "o", "mujoco": "x", "recording": "o"}
LOWEST = 1e-6  # of the largest power; what is less is not drawn
LEGEND = 0.1  # of the height of the axes: a line of the legend
LINE: Mapping[str, str] = {"linear": "-", "mujoco": "--", "recording": "-"}


class Shown(Protocol):
    """The result of one case on one plant."""

    @property
    def title(self) -> str: ...

    @property
    def plant(self) -> str: ...

    @property
    def finding(self) -> Finding | None: ...


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


def standing_figure(found: Sequence[Shown]) -> Figure:
    """Left: density of the first signal in units of its deviation, dotted: normal; right: density of the intervals."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(150 * style.MM, 70 * style.MM))
    place, times = (figure.add_axes((left, 0.14, 0.4, 0.68)) for left in (0.09, 0.58))
    edges = np.linspace(-4, 4, 61)
    middle = (edges[1:] + edges[:-1]) / 2
    for one, colour, words in coloured(found):
        if not isinstance(one.finding, Standing):
            continue
        density, _ = np.histogram(one.finding.positions[:, 0], edges, density=True)
        place.plot(middle, density, color=colour, linestyle=LINE[one.plant], linewidth=1.2, label=words)
        intervals = one.finding.intervals
        if len(intervals) > 1 and np.ptp(intervals) > 1e-6 * intervals.mean():
            counts, bins = np.histogram(intervals, 40, density=True)
            times.stairs(counts, bins, color=colour, linestyle=LINE[one.plant], linewidth=1.2)
    place.plot(middle, np.exp(-(middle**2) / 2) / np.sqrt(2 * np.pi), **style.CRITICAL)
    place.set(xlabel="position (standard deviations)", ylabel="density (1/SD)")
    times.set(xlabel=r"interval $\Delta_{ol}$ (s)", ylabel="density (1/s)")
    if not times.patches:
        times.set_visible(False)
    style.legend(figure, place, columns=2)
    return figure


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
    gain.set(xscale="log", yscale="log", ylabel="gain (response/stimulus)")
    phase.set(ylabel="phase (°)", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    power.set(yscale="log", ylabel="power (response²)", xlabel="frequency (Hz)")
    if highest > 0:
        power.set_xlim(ends[0] / 2, 2 * ends[1])
        power.set_ylim(bottom=LOWEST * highest, top=3 * highest)
    low, high = gain.get_ylim()
    rows = -(-len(gain.get_legend_handles_labels()[1]) // 2)
    gain.set_ylim(low, high * (high / low) ** (LEGEND * max(rows - 2, 0)))  # two fit above the axes
    style.legend(figure, gain, columns=2)
    return figure
