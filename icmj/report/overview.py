"""The first figure of the page: of every case the predicted interval, the measured ones, and how far apart they are."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.report import style
from icmj.report.case_runs import CaseRuns, is_noisy
from icmj.report.judgement import judge_run
from icmj.report.notation import unbroken

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


WIDTH, ROW, ABOVE, BELOW = 140.0, 5.6, 11.5, 10.5  # mm
NARROW, TALL, ROOF = 88.0, 9.6, 16.5  # mm: width, height of a row and space above the rows on a telephone
LINE, SIZE = 3.0, 8.2  # mm, points: of a line of a title beyond the first, and of all titles
LONGEST, LONG = 40, 54  # characters of a line of a title beside its row, and above it
WIDE = 4.0  # largest over smallest interval from which on their axis is logarithmic
EXACT = 1e-16  # relative error that is drawn of what agrees to the last digit
COLOUR = {"✓": "#00664b", "○": "#6b5300", "✗": "#a03c00"}


def overview_figure(cases: Sequence[CaseRuns], *, narrow: bool = False) -> Figure:
    """Intervals at the left, their relative errors in the middle, the verdict in words at the right; a row a case.

    Args:
        cases: one row each.
        narrow: draw for a page of 390 pixels, with the titles above the rows instead of beside them.
    """
    from matplotlib.figure import Figure

    width, pitch, above = (NARROW, TALL, ROOF) if narrow else (WIDTH, ROW, ABOVE)
    titles = [_balance(case.first.run.title, LONG if narrow else LONGEST) for case in cases]
    pitches = pitch + LINE * np.array([title.count("\n") for title in titles])
    ends = np.cumsum(pitches)  # mm from the upper edge of the axes, as are the rows
    rows = ends - pitch / 2 + 2.0 if narrow else ends - pitches / 2
    height = above + BELOW + ends[-1]
    figure = Figure(figsize=(width * style.MM, height * style.MM))
    left = 3.0 if narrow else 3.0 + max(map(_width, titles))
    middle, right = width - 44.0, width - 24.0
    low, share = BELOW / height, ends[-1] / height
    intervals = figure.add_axes((left / width, low, (middle - 4 - left) / width, share))
    errors = figure.add_axes((middle / width, low, (right - middle) / width, share), sharey=intervals)
    for axes, draw in ((intervals, draw_intervals), (errors, draw_errors)):
        draw(axes, cases, rows)
        axes.set_ylim(ends[-1], 0)
        axes.spines["left"].set_visible(False)
        axes.tick_params(axis="y", length=0, labelsize=8.0)
    errors.tick_params(labelleft=False)
    if narrow:
        intervals.set_yticks([])
        for end, pitch, title in zip(ends, pitches, titles, strict=True):
            at = 1 - (above + end - pitch + 0.9) / height
            figure.text(left / width, at, title, va="top", size=SIZE, linespacing=1.0, parse_math=False)
    else:
        intervals.set_yticks(rows, titles, size=SIZE, parse_math=False, linespacing=1.0)
    for row, case in zip(rows, cases, strict=True):
        mark, words = _verdict(case)
        errors.text(
            1.06, row, f"{mark} {words}".strip(), transform=errors.get_yaxis_transform(), va="center", size=8.2,
            color=COLOUR.get(mark, "#555555"), family=["STIXGeneral", "DejaVu Sans"],
        )  # fmt: skip
    for x, words in ((left, "open-loop interval"), (middle, "relative error"), (right + 1.2, "agreement")):
        figure.text(x / width, 1 - (above - 5.9) / height, words, size=8.4, style="italic", va="top")
    handles = dict(zip(*reversed(intervals.get_legend_handles_labels()), strict=True))
    figure.legend(
        handles.values(), handles.keys(), loc="upper right", bbox_to_anchor=(1 - 1.0 / width, 1 - 0.4 / height),
        ncols=2 if narrow else 5, fontsize=8.2,
    )  # fmt: skip
    return figure


def _balance(title: str, longest: int) -> str:
    """A title on as few lines as this length allows, about equally long; quantities stay with their units."""
    title, width = str(unbroken(title)), longest
    lines = fill(title, width)
    while width > 10 and fill(title, width - 1).count("\n") == lines.count("\n"):
        width -= 1
    return fill(title, width)


def _width(title: str) -> float:
    """The width of a title beside its row [mm]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family=style.RC["font.family"])
    lines = (line.replace("$", r"\$") for line in title.split("\n"))
    return max(float(TextPath((0, 0), line, SIZE, prop=font).get_extents().width) for line in lines) / 72 / style.MM


def draw_intervals(axes: Axes, cases: Sequence[CaseRuns], rows: Array) -> None:
    """Predicted Δ_crit as a broad bar, measured intervals on it; where nothing settles, a range or nothing."""
    shown: list[float] = []
    for row, case in zip(rows, cases, strict=True):
        axes.axhline(row, color="#e6e3db", linewidth=0.5, zorder=0)
        delta = case.prediction.delta_crit
        if delta is not None and (case.prediction.cycle or not is_noisy(case)):
            hollow = {} if case.prediction.cycle else {"markerfacecolor": "white", "markeredgecolor": "#b5ad93"}
            look: dict[str, Any] = {"color": "#cfc8b2", "markersize": 13, "markeredgewidth": 1.0, **hollow}
            label = "predicted" if case.prediction.cycle else r"$\Delta_{crit}$, no cycle predicted"
            axes.plot(delta, row, linestyle="none", label=label, zorder=1, **_bar(look))
            shown.append(delta)
        for plant, result in case.runs.items():
            interval, noisy = case.comparisons[plant].measured.interval, result.statistics
            if interval is None or not np.isfinite(interval) or interval <= 0:
                continue
            shown.append(interval)
            if noisy is not None and noisy.interval_deviation is not None:
                ends = [
                    max(interval - noisy.interval_deviation.value, interval / 10),
                    interval + noisy.interval_deviation.value,
                ]
                axes.plot(ends, [row, row], **style.RUN[plant], zorder=2)
                shown += ends
            look = {"linestyle": "none", **style.MARK[plant], "zorder": 3}
            if case.comparisons[plant].measured.kind == "homoclinic":
                arrow = {"arrowstyle": "->", "color": style.RUN[plant]["color"], "shrinkB": 0}
                axes.annotate("", (interval * 2, row), (interval, row), arrowprops=arrow, zorder=2)
            axes.plot(interval, row, label=style.NAME[plant] if plant == "mujoco" else "linear plant", **look)
    low, high = min(shown, default=1.0), max(shown, default=1.0)
    if high > WIDE * low:
        axes.set_xscale("log")
        ticks = [t for t in (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100) if low / 1.5 < t < high * 1.5]
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.minorticks_off()
        axes.set_xlim(low / 1.35, high * 1.35)
    else:
        apart = max(0.25 * (high - low), 0.2 * low)  # what agrees to a percent is seen to agree
        axes.set_xlim(low - apart, high + apart)
        axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(r"$\Delta_{ol}$ (s)")


def draw_errors(axes: Axes, cases: Sequence[CaseRuns], rows: Array) -> None:
    """Magnitude of the relative error of the interval, on a logarithmic axis, where a cycle is predicted."""
    for row, case in zip(rows, cases, strict=True):
        axes.axhline(row, color="#e6e3db", linewidth=0.5, zorder=0)
        for plant, comparison in case.comparisons.items():
            error = comparison.relative_error.interval
            if error is not None and comparison.measured.kind != "noisy":
                axes.plot(max(abs(error), EXACT), row, linestyle="none", **style.MARK[plant])
    axes.set_xscale("log")
    axes.set_xlim(EXACT / 5, 3.0)
    axes.set_xticks([1e-15, 1e-8, 1], ["$10^{-15}$", "$10^{-8}$", "1"])
    axes.minorticks_off()
    axes.set_xlabel(r"$|\Delta_{ol}/\Delta_{crit}-1|$")


def _bar(look: dict[str, Any]) -> dict[str, Any]:
    from matplotlib.path import Path

    tall = Path([(-0.13, -0.5), (0.13, -0.5), (0.13, 0.5), (-0.13, 0.5), (-0.13, -0.5)], closed=True)
    return {**look, "marker": tall}


def _verdict(case: CaseRuns) -> tuple[str, str]:
    """Mark and word of the plant drawn last, which is the one that need not agree."""
    mark, word, _ = judge_run(case.comparisons[case.last.simulation.plant])
    return (mark, word) if mark in COLOUR else ("", word or "–")


CAPTION = (
    "Each row is a case. Broad bar: the open-loop interval Δ_crit that linear theory predicts, hollow where it "
    "predicts no cycle. Marks: the intervals Δ_ol between the last events of the simulated runs. A mark on its bar "
    "agrees with the prediction; the relative error shows how closely (the further left, the closer). {}"
)
ARROW = "Arrow: the intervals grow without bound. "
NOISE = "Line: mean and standard deviation of the intervals under noise. "
PLANT = "Linear plant: the body’s own equations, linearised at the pose in which it is balanced. "
WORDS = "✓ agrees with the prediction; ○ a cycle that is not predicted; ✗ a predicted cycle is not reached."


def describe_overview(cases: Sequence[CaseRuns]) -> str:
    """What the overview shows of these cases, in words."""
    grows = any(c.measured.kind == "homoclinic" for case in cases for c in case.comparisons.values())
    linearised = any(case.linear is not None and case.first.run.on_engine for case in cases)
    return CAPTION.format(PLANT * linearised + ARROW * grows + NOISE * any(map(is_noisy, cases)) + WORDS)
