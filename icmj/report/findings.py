"""Figures of what experiments find: colours and legends of their cases; reaction times, and pairs of steps.

Figures of a fit: posterior beside prior, recorded beside simulated sway, calibration, confusion, groups.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill as fill_lines
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from icmj.base.array import Array, count_steps, is_between
from icmj.errors import ReportError
from icmj.experiments.reconstruction import Reconstruction
from icmj.experiments.recording import Finding
from icmj.experiments.refractoriness import Refractoriness
from icmj.measurement.statistics import cut_windows, hann
from icmj.report import style
from icmj.report.notation import symbol
from icmj.report.sway_figures import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKER = {"linear": "o", "mujoco": "x", "recording": "o"}
LOWEST = 1e-6  # of the largest power; what is less is not drawn
LINE: Mapping[str, str] = {"linear": "-", "mujoco": "--", "recording": "-"}


class ShownResult(Protocol):
    """The result of one case on one plant."""

    @property
    def title(self) -> str: ...

    @property
    def plant(self) -> str: ...

    @property
    def finding(self) -> Finding | None: ...


def assign_colours(found: Sequence[ShownResult]) -> list[tuple[ShownResult, str]]:
    """The results, each with the colour of its case."""
    titles = list(dict.fromkeys(one.title for one in found))
    return [(one, COLOURS[titles.index(one.title) % len(COLOURS)]) for one in found]


def legend_of_cases(figure: Figure, found: Sequence[ShownResult], *, markers: bool = False) -> float:
    """A legend above the axes: the colour of each case, and the line or marker of each plant where there are two.

    Returns:
        its height [inches], which the axes leave free.
    """
    from matplotlib.lines import Line2D

    colours = {one.title: colour for one, colour in assign_colours(found)}
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


def under_legend(figure: Figure, axes: Sequence[Axes], found: Sequence[ShownResult], *, markers: bool = False) -> None:
    """Draw the legend of cases, and leave room for it above the axes, which share it in proportion."""
    room = legend_of_cases(figure, found, markers=markers)
    boxes = [each.get_position() for each in axes]
    low, high = min(box.y0 for box in boxes), max(box.y1 for box in boxes)
    share = (1 - (room + 0.1) / figure.get_size_inches()[1] - low) / (high - low)
    for each, box in zip(axes, boxes, strict=True):
        each.set_position((box.x0, low + (box.y0 - low) * share, box.width, box.height * share))


_FIRST, _SECOND = "#0072b2", "#d55e00"
_BEFORE, _AFTER = 0.3, 1.0  # s about a pair


def draw_reactions(axes: Axes, found: Refractoriness) -> None:
    """Mean RT1 and RT2 with twice their standard errors, and both regressions of RT2 where they find a period."""
    for rt, error, colour, name in (
        (found.rt1, found.rt1_error, _FIRST, "RT1"),
        (found.rt2, found.rt2_error, _SECOND, "RT2"),
    ):
        axes.errorbar(
            found.isi, rt, 2 * error, color=colour, marker="o", markersize=4, linestyle="none", capsize=2, label=name
        )
    isi = np.linspace(0, found.isi[-1], 500)
    for estimate, slope, line, name in (
        (found.free, found.slope.value, "-", "free regression"),
        (found.fixed, -1.0, (0, (5, 1.5)), "slope −1"),
    ):
        if estimate.low > 0 and np.isfinite(slope):
            course = found.rt1_mean + np.maximum(estimate.value + slope * isi, 0.0)
            label = f"{name}: {estimate.value:.3f} s ({estimate.low:.3f} to {estimate.high:.3f})"
            axes.plot(isi, course, color="#222222", linewidth=0.9, linestyle=line, label=label)
    axes.axhline(found.rt1_mean, color=_FIRST, linewidth=0.8, linestyle=(0, (1, 1.6)))
    axes.set(xlabel="interval between the steps (s)", ylabel="reaction time (s)", xlim=(0, None), ylim=(0, None))


def draw_reconstruction(axes: Axes, found: Reconstruction, pair: int) -> None:
    """The control about one pair, the model's, and the set-point with its steps at their true and at moved times.

    The set-point is drawn as the model's control would come to rest, one above the other.

    Raises:
        ReportError: if there is no such pair.
    """
    pairs = found.pairs
    if not -len(pairs) <= pair < len(pairs):
        raise ReportError(f"no pair {pair} of {len(pairs)}")
    (first, second), rt = pairs.t[pair], found.rt[pair]
    shown = is_between(found.t, first - _BEFORE, second + _AFTER)
    t, u = found.t[shown] - first, found.u[shown]
    axes.plot(t, u, color="#8a8a8a", linewidth=1.6, label="control")
    axes.plot(t, found.fit[shown], color="#222222", linewidth=0.9, linestyle=(0, (5, 1.5)), label="linear model")
    low, high = float(u.min()), float(u.max())
    height = 0.22 * max(high - low, 1e-12) / np.abs(np.cumsum(pairs.sizes[pair])).max()
    for at, colour, words, below in (
        (np.zeros(2), _FIRST, "steps", 0.35),
        (rt, _SECOND, "steps, moved", 0.7),
    ):
        if np.isfinite(at).all():
            edges = [t[0], *(pairs.t[pair] + at - first), t[-1]]
            level = low - below * (high - low) + height * np.append(0.0, np.cumsum(pairs.sizes[pair]))
            axes.stairs(level, edges, baseline=None, color=colour, linewidth=1.2, label=words)
    unit = f" ({found.unit})" if found.unit else ""
    axes.set(xlabel="time since the first step (s)", ylabel=f"control{unit}", xlim=(t[0], t[-1]))


_POSTERIOR, _PRIOR, _RECORDED, _BAD = "#0072b2", "#b8b2a0", "#222222", "#d55e00"
_ACROSS = 4


def math_name(name: str) -> str:
    """The name of a parameter for matplotlib: symbols with their subscript, words as they are."""
    head, _, index = symbol(name).partition("_")
    return rf"${head}_{{{index}}}$" if index and len(head) == 1 else style.words(symbol(name))


def posterior_figure(
    names: Sequence[str], units: Sequence[str], theta: Array, prior: Array, notes: Sequence[str]
) -> Figure:
    """The marginal posteriors of p numbers (draws, p), each before its prior, with a note such as ``identified``."""
    from matplotlib.ticker import NullFormatter

    figure, every = _grid(len(names))
    for axes, name, unit, drawn, before, note in zip(every, names, units, theta.T, prior.T, notes, strict=True):
        low, high = np.quantile(before, (0.002, 0.998))
        logarithmic = low > 0 and high > 15 * low
        edges = np.geomspace(low, high, 41) if logarithmic else np.linspace(low, high, 41)
        for values, look in (
            (before, {"color": _PRIOR, "alpha": 0.55}),
            (drawn, {"color": _POSTERIOR if note == "identified" else "#7f9fb5", "alpha": 0.8}),
        ):
            share = np.histogram(values, edges)[0] / len(values)
            axes.stairs(share, edges, fill=True, **look)
        if logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set(yticks=[], ylim=(0, None), xlabel=f"{name} ({unit})" if unit else name)
        axes.spines["left"].set_visible(False)
        axes.set_title(note, fontsize="small", color="#222222" if note == "identified" else "#8a8a8a")
    return figure


def sway_figure(
    recorded: Sequence[Array],
    simulated: Sequence[Array],
    rate: float,
    names: Sequence[str],
    predicted: Array,
    observed: Array,
) -> Figure:
    """Recorded beside simulated sway: paths, spectra, and each measure with its predictive interval of 90 %.

    Args:
        recorded, simulated: centre of pressure of trials [m].
        rate: of them [Hz].
        names: of m measures, with their units.
        predicted, observed: what simulated trials (n, m) and recorded ones (k, m) measure.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(170 * style.MM, 120 * style.MM), layout="constrained")
    above, below = np.ravel(figure.subfigures(2, 1, height_ratios=(1.25, 1), squeeze=False))
    path, spectrum = above.subplots(1, 2, width_ratios=(1.7, 1))
    named: set[str] = set()
    lines = [(x, _RECORDED, "recorded") for x in recorded] + [(x, _POSTERIOR, "simulated") for x in simulated]
    room = 1000 * max(float(np.ptp(x)) for x, _, _ in lines)
    for i, (x, colour, name) in enumerate(lines):
        path.plot(np.arange(len(x)) / rate, 1000 * (x - x.mean()) - 1.05 * i * room, color=colour, linewidth=0.7)
        parts = cut_windows(x[:, None], min(len(x), count_steps(20.48 * rate)), "linear")[:, :, 0]
        f, power = np.fft.rfftfreq(parts.shape[1], 1 / rate), (np.abs(np.fft.rfft(parts, axis=1)) ** 2).mean(axis=0)
        power *= 2 / rate / (hann(parts.shape[1]) ** 2).sum()
        kept = (f > 0) & is_between(f, 0.0, 10.0)
        label = None if name in named else name
        spectrum.loglog(f[kept], 1e6 * power[kept], color=colour, linewidth=0.8, alpha=0.8, label=label)
        named.add(name)
    path.set(xlabel="time (s)", ylabel="centre of pressure (mm), shifted", yticks=[])
    foot = 0.62 * room
    path.plot([0, 0], [foot, foot + 10], color="#8a8a8a", linewidth=2)
    path.annotate("10 mm", (0, foot + 5), xytext=(4, 0), textcoords="offset points", va="center", fontsize=7)
    spectrum.set(xlabel="frequency (Hz)", ylabel="power (mm²/Hz)")
    spectrum.legend()
    row = np.ravel(below.subplots(1, len(names), squeeze=False))
    for axes, name, drawn, trials in zip(row, names, predicted.T, observed.T, strict=True):
        low, high = np.quantile(drawn, (0.05, 0.95))
        axes.fill_between([-0.3, 0.3], low, high, color=_POSTERIOR, alpha=0.25, linewidth=0)
        axes.plot([-0.3, 0.3], [np.median(drawn)] * 2, color=_POSTERIOR, linewidth=1.2)
        at = np.linspace(-0.15, 0.15, len(trials)) if len(trials) > 1 else np.zeros(1)
        good = (trials >= low) & (trials <= high)
        axes.plot(at[good], trials[good], "o", color=_RECORDED, markersize=3.5)
        axes.plot(at[~good], trials[~good], "o", color=_BAD, markersize=3.5)
        axes.set(xticks=[], xlim=(-0.6, 0.6), xlabel=fill_lines(name, 13))
        if low > 0 and min(trials) > 0:
            axes.set_ylim(0, None)
    return figure


def calibration_figure(names: Sequence[str], ranks: Array, notes: Sequence[str]) -> Figure:
    """How far the distribution of each number's ranks (n, p) is from the uniform one, with its band of 95 %."""
    figure, every = _grid(len(names))
    n = len(ranks)
    x = np.linspace(0, 1, 201)
    band = 1.96 * np.sqrt(x * (1 - x) / n)
    for axes, name, column, note in zip(every, names, ranks.T, notes, strict=True):
        axes.fill_between(x, -band, band, color=_PRIOR, alpha=0.5, linewidth=0)
        share = np.searchsorted(np.sort(column), x, side="right") / n - x
        axes.plot(x, share, color=_BAD if note == "not calibrated" else _POSTERIOR, linewidth=1.0)
        axes.set(xlabel=f"rank of {name}", ylim=(-0.2, 0.2), xticks=[0, 0.5, 1])
        axes.set_title(note, fontsize="small", color="#222222" if note == "identified" else "#8a8a8a")
    return figure


def confusion_figure(families: Sequence[str], counts: Array) -> Figure:
    """Synthetic people of each family (rows), and the family that they were given to (columns), in shares."""
    from matplotlib.figure import Figure

    m = len(families)
    figure = Figure(figsize=((40 + 18 * m) * style.MM, (28 + 12 * m) * style.MM), layout="constrained")
    axes: Axes = figure.subplots()
    share = counts / counts.sum(axis=1, keepdims=True)
    axes.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for i in range(m):
        for j in range(m):
            colour = "white" if share[i, j] > 0.6 else "#222222"
            axes.text(j, i, f"{share[i, j]:.0%}", ha="center", va="center", color=colour)
    axes.set(xlabel="assigned to", ylabel="simulated with", yticks=range(m), yticklabels=families)
    axes.set_xticks(range(m), families, rotation=30, ha="right")
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    axes.tick_params(length=0)
    return figure


def groups_figure(labels: Sequence[str], value: Array, low: Array, high: Array, verdicts: Sequence[str]) -> Figure:
    """Differences between groups with their intervals of 95 %; one without a conclusion has a label alone."""
    from matplotlib.figure import Figure

    n = len(labels)
    figure = Figure(figsize=(130 * style.MM, (18 + 6 * n) * style.MM), layout="constrained")
    axes: Axes = figure.subplots()
    for i in range(n):
        if not np.isfinite(value[i]):
            axes.annotate(verdicts[i], (0.02, i), xycoords=("axes fraction", "data"), va="center", color="#8a8a8a")
            continue
        colour = _BAD if verdicts[i] == "differs" else _POSTERIOR
        axes.plot([low[i], high[i]], [i, i], color=colour, linewidth=1.2)
        axes.plot(value[i], i, "o", color=colour, markersize=4)
    axes.axvline(0, color="#8a8a8a", linewidth=0.7)
    axes.set(ylim=(n - 0.5, -0.5), yticks=range(n), yticklabels=labels)
    axes.set_xlabel("difference (standard deviations of the prior)")
    return figure


def _grid(count: int) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    rows = -(-count // _ACROSS)
    figure = Figure(figsize=(170 * style.MM, (6 + 33 * rows) * style.MM), layout="constrained")
    every = list(np.ravel(figure.subplots(rows, _ACROSS, squeeze=False)))
    for axes in every[count:]:
        axes.set_axis_off()
    return figure, every[:count]
