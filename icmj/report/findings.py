"""Figures of what experiments find: intersection point of ground reaction forces, quiet standing, multi-sines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from icmj.base.array import Array
from icmj.base.numbers import readable
from icmj.experiments.quiet_standing import Standing
from icmj.experiments.recording import Finding
from icmj.report import style
from icmj.report.sway import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKER = {"linear": "o", "mujoco": "x", "recording": "o"}
LOWEST = 1e-6  # of the largest power; what is less is not drawn
LINE: Mapping[str, str] = {"linear": "-", "mujoco": "--", "recording": "-"}


class Shown(Protocol):
    """The result of one case on one plant."""

    @property
    def title(self) -> str: ...

    @property
    def plant(self) -> str: ...

    @property
    def finding(self) -> Finding | None: ...


def coloured(found: Sequence[Shown]) -> list[tuple[Shown, str]]:
    """The results, each with the colour of its case."""
    titles = list(dict.fromkeys(one.title for one in found))
    return [(one, COLOURS[titles.index(one.title) % len(COLOURS)]) for one in found]


def legend_of_cases(figure: Figure, found: Sequence[Shown], *, markers: bool = False) -> float:
    """A legend above the axes: the colour of each case, and the line or marker of each plant where there are two.

    Returns:
        its height [inches], which the axes leave free.
    """
    from matplotlib.lines import Line2D

    colours = {one.title: colour for one, colour in coloured(found)}
    handles = [Line2D([], [], color=of, linewidth=2.4, label=style.words(title)) for title, of in colours.items()]
    plants = list(dict.fromkeys(one.plant for one in found))
    for plant in plants if len(plants) > 1 else ():
        look: dict[str, Any] = {"linestyle": LINE[plant], "linewidth": 1.2}
        if markers:
            look = {"linestyle": "none", "marker": MARKER[plant], "markersize": 4.0, "fillstyle": "none"}
        name = "linear plant" if plant == "linear" else style.NAME[plant]
        handles.append(Line2D([], [], color="#555555", label=name, **look))
    width, height = figure.get_size_inches()
    for columns in range(min(6, len(handles)), 0, -1):
        legend = figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(0.35 / width, 1 - 0.03 / height), ncols=columns
        )
        box = legend.get_window_extent()
        if columns == 1 or box.width < (width - 0.5) * figure.dpi:
            return float(box.height) / figure.dpi + 0.03
        legend.remove()
    raise AssertionError("a legend of one column is always taken")


def under_legend(figure: Figure, axes: Sequence[Axes], found: Sequence[Shown], *, markers: bool = False) -> None:
    """Draw the legend of cases, and leave room for it above the axes, which share it in proportion."""
    room = legend_of_cases(figure, found, markers=markers)
    boxes = [each.get_position() for each in axes]
    low, high = min(box.y0 for box in boxes), max(box.y1 for box in boxes)
    share = (1 - (room + 0.1) / figure.get_size_inches()[1] - low) / (high - low)
    for each, box in zip(axes, boxes, strict=True):
        each.set_position((box.x0, low + (box.y0 - low) * share, box.width, box.height * share))


def intersection_figure(found: Sequence[Shown]) -> Figure:
    """z over the height of the centre of mass against frequency; dotted: that height, thin: theory."""
    figure, (axes,) = style.new_figure(80.0, width=140.0)
    ratios, lowest = True, 1.0
    for one, colour in coloured(found):
        if one.finding is None:
            continue
        curves = one.finding.curves
        f, ratio = curves["frequency (Hz)"], curves["z/h"]
        ratios = ratios and bool(np.isfinite(ratio).all())
        z = ratio if ratios else curves["z (m)"]
        by = _by(curves) if ratios else 1.0
        axes.semilogy(f, z, color=colour, linestyle=LINE[one.plant], linewidth=1.3)
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
    under_legend(figure, [axes], found)
    return figure


def _by(curves: Mapping[str, Array]) -> float:
    """The height of the centre of mass by which results are divided [m]."""
    good = curves["z/h"] != 0
    return float(np.median(curves["z (m)"][good] / curves["z/h"][good]))


def standing_figure(found: Sequence[Shown]) -> Figure:
    """Left: density of the first signal in units of its deviation, dotted: normal; right: density of the intervals."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(150 * style.MM, 70 * style.MM))
    place, times = (figure.add_axes((left, 0.14, 0.4, 0.82)) for left in (0.09, 0.58))
    edges = np.linspace(-4, 4, 61)
    middle = (edges[1:] + edges[:-1]) / 2
    for one, colour in coloured(found):
        if not isinstance(one.finding, Standing):
            continue
        density, _ = np.histogram(one.finding.positions[:, 0], edges, density=True)
        place.plot(middle, density, color=colour, linestyle=LINE[one.plant], linewidth=1.2)
        intervals = one.finding.intervals
        if len(intervals) > 1 and np.ptp(intervals) > 1e-6 * intervals.mean():
            counts, bins = np.histogram(intervals, 40, density=True)
            times.stairs(counts, bins, color=colour, linestyle=LINE[one.plant], linewidth=1.2)
    place.plot(middle, np.exp(-(middle**2) / 2) / np.sqrt(2 * np.pi), **style.CRITICAL)
    place.set(xlabel="position (standard deviations)", ylabel="density (1/SD)")
    times.set(xlabel=r"interval $\Delta_{ol}$ (s)", ylabel="density (1/s)")
    if not times.patches:
        times.set_visible(False)
        place.set_position((0.09, 0.14, 0.89, 0.82))
    under_legend(figure, [place, times], found)
    return figure


def multisine_figure(found: Sequence[Shown], units: tuple[str, str]) -> Figure:
    """Gain with 95 % confidence, phase, power; line: theory; rings and crosses: excited lines; points: the remnant.

    ``units`` are those of stimulus and response.
    """
    figure, (gain, phase, power) = style.new_figure(150.0, rows=3, width=150.0)
    (of_stimulus, stimulus), (of_response, response_unit) = map(readable, units)
    scale = of_response / of_stimulus
    highest, least, ends = 0.0, np.inf, (np.inf, 0.0)
    for one, colour in coloured(found):
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
        size, radius = scale * np.abs(response), scale * curves["radius"][excited]
        gain.errorbar(lines, size, radius, elinewidth=0.6, **style_of)
        least = min(least, float(size[size > 0].min(initial=np.inf)))
        phase.plot(lines, np.degrees(np.angle(response)), **style_of)
        theory = (curves["theory, real"] + 1j * curves["theory, imag"])[excited]
        gain.plot(lines, scale * np.abs(theory), color="#222222", linewidth=0.6)
        phase.plot(*_unwound(lines, np.degrees(np.angle(theory))), color="#222222", linewidth=0.6)
        values, ends = of_response**2 * curves["power"], (min(ends[0], lines[0]), max(ends[1], lines[-1]))
        power.plot(f[~excited], values[~excited], color=colour, linestyle="none", marker=".", markersize=1, zorder=1)
        power.plot(lines, values[excited], **style_of)
        highest = max(highest, float(values.max(initial=0.0)))
    over = f"({stimulus})" if " " in stimulus else stimulus
    squared = f"({response_unit})²" if " " in response_unit else f"{response_unit}²"
    gain.set(xscale="log", yscale="log", ylabel=f"gain ({response_unit}/{over})")
    phase.set(ylabel="phase (°)", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    power.set(yscale="log", ylabel=f"power ({squared})", xlabel="frequency (Hz)")
    if np.isfinite(least):
        gain.set_ylim(bottom=least / 3)
    if highest > 0:
        power.set_xlim(ends[0] / 2, 2 * ends[1])
        power.set_ylim(bottom=LOWEST * highest, top=3 * highest)
    figure.align_ylabels([gain, phase, power])
    under_legend(figure, [gain, phase, power], found, markers=True)
    return figure


def _unwound(x: Array, phase: Array) -> tuple[Array, Array]:
    """A line that is broken where the phase [°] goes around."""
    gaps = 1 + np.flatnonzero(np.abs(np.diff(phase)) > 180)
    return np.insert(x, gaps, np.nan), np.insert(phase, gaps, np.nan)
