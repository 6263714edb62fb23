"""Figures of double steps: reaction times against the interval between steps, and one pair as it was reconstructed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import between
from icmj.errors import ReportError
from icmj.experiments.double_step.reconstruction import Reconstruction
from icmj.experiments.double_step.refractoriness import Refractoriness
from icmj.report import style
from icmj.report.findings import LINE, Shown, coloured, under_legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
    shown = between(found.t, first - _BEFORE, second + _AFTER)
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


def double_step_figure(found: Sequence[Shown], example: Reconstruction | None) -> Figure:
    """RT1 (open) and RT2 (filled) of every case against the interval, and one reversal as it was reconstructed."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(170 * style.MM, 80 * style.MM))
    times, pair = (figure.add_axes((left, 0.13, wide, 0.82)) for left, wide in ((0.075, 0.47), (0.635, 0.35)))
    for one, colour in coloured(found):
        if one.finding is None:
            continue
        curves = one.finding.curves
        look: dict[str, Any] = {
            "color": colour,
            "linewidth": 1.0,
            "linestyle": LINE[one.plant],
            "capsize": 1.5,
            "elinewidth": 0.6,
        }
        for name, fill in (("RT1", "none"), ("RT2", "full")):
            error = 2 * curves[f"{name}, error (s)"]
            times.errorbar(
                curves["ISI (s)"], curves[f"{name} (s)"], error, marker="o", markersize=3.5, fillstyle=fill, **look
            )
    times.set(xlabel="interval between the steps (s)", ylabel="reaction time (s)", xlim=(0, None))
    low, high = times.get_ylim()
    times.set_ylim(0, high + 0.08 * (high - low))
    ring: dict[str, Any] = {"color": "#555555", "linestyle": "none", "marker": "o", "markersize": 4}
    first = Line2D([], [], fillstyle="none", label="first step", **ring)
    times.legend(handles=[first, Line2D([], [], label="second step", **ring)], loc="upper right", ncols=2)
    under_legend(figure, [times, pair], found)
    if example is not None:
        turned = np.flatnonzero(~example.pairs.same & np.isfinite(example.rt).all(axis=1))
        shown = turned if len(turned) else np.arange(len(example.pairs))
        draw_reconstruction(pair, example, int(shown[np.argsort(example.pairs.isi[shown])[len(shown) // 4]]))
        low, high = pair.get_ylim()
        pair.set_ylim(low, high + 0.22 * (high - low))
        pair.legend(loc="upper right", ncols=2)
    return figure
