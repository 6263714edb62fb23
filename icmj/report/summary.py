"""The summary: paper, prediction, linear plant and MuJoCo side by side, and the headline.

The cases that noise drives: distributions instead of a cycle.

The first figure of the page: of every case the predicted interval, the measured ones, and how far apart they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from icmj.base import numbers
from icmj.base.array import Array
from icmj.base.numbers import count
from icmj.case.comparison import Comparison
from icmj.case.quantity import in_unit, quantities
from icmj.experiments.quiet_standing import YOUNG_PEOPLE
from icmj.measurement.statistics import Estimate
from icmj.measurement.sway import MEASURES
from icmj.report import style
from icmj.report.notation import unbroken
from icmj.report.statements import STATEMENTS, Verdict, verdicts_on_results
from icmj.report.style import NAME
from icmj.report.wording import CaseRuns, Picture, Section, judge_run, notice_in_words, verdicts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNITS = {"rms": "m", "speed": "m/s", "frequency.mean": "Hz"}  # of measures of the centre of pressure


def is_noisy(case: CaseRuns) -> bool:
    """Whether noise acts in a case, so that no cycle can be reached in it."""
    return case.first.run.simulation.settings().noisy


def noise(
    cases: Sequence[CaseRuns], pictures: Mapping[str, tuple[Picture, Picture]], first_number: int
) -> Section | None:
    """Histogram, spectra and numbers of every case under noise, or ``None`` where there is none.

    Args:
        cases: all cases.
        pictures: histogram and spectra by case.
        first_number: number of the first figure.
    """
    shown = [case for case in cases if case.name in pictures]
    items = [
        {
            "title": case.first.run.title,
            "number": number,
            "pictures": pictures[case.name],
            "outputs": [
                shown.label(name).replace("deg", "°")
                for name, shown in zip(case.first.actual.outputs, quantities(case.first.actual), strict=True)
            ],
            "rows": _rows(case),
            "cycle": _cycle_sentence(case),
            "sway": _sway(case),
        }
        for number, case in enumerate(shown, first_number)
    ]
    return Section("noise", "Under noise", "noise.html.j2", {"items": items}) if items else None


def estimate(found: Estimate | None, unit: float = 1.0) -> str:
    """A number with its confidence, in another unit where it is multiplied by ``unit``."""
    if found is None:
        return numbers.MISSING
    error = "" if not np.isfinite(found.error) else f" ± {numbers.number(found.error * unit, 1)}"
    return f"{numbers.number(found.value * unit, 3)}{error}"


def _rows(case: CaseRuns) -> list[dict[str, Any]]:
    rows = []
    for plant, result in case.runs.items():
        found = result.statistics
        if found is not None:
            rows.append(
                {
                    "plant": NAME[plant],
                    "events": found.events,
                    "interval": estimate(found.interval),
                    "deviation": estimate(found.interval_deviation),
                    "binding": estimate(found.binding, 100) if found.least > 0 else numbers.MISSING,
                    "rms": [
                        estimate(rms, shown.factor)
                        for rms, shown in zip(found.rms, quantities(result.actual), strict=True)
                    ],
                }
            )
    return rows


def _sway(case: CaseRuns) -> dict[str, Any] | None:
    """Measures of the centre of pressure on each plant beside those of young people; ``None`` if there are none."""
    swayed = {plant: result for plant, result in case.runs.items() if result.sway}
    if not swayed:
        return None
    rows = []
    called = {measure.key: measure.words for measure in MEASURES}
    for key, (mean, spread) in YOUNG_PEOPLE.items():
        factor, unit = numbers.readable(UNITS.get(key, ""))
        values = (result.sway.get(f"cop.x.{key}") for result in swayed.values())
        own = [numbers.number(None if value is None else factor * value, 3) for value in values]
        young = f"{numbers.number(factor * mean, 3)} ± {numbers.number(factor * spread, 2)}"
        rows.append((in_unit(called[key], unit), *own, young))
    found = next(result.statistics for result in swayed.values() if result.statistics is not None)
    heads = ["linear plant" if plant == "linear" else NAME[plant] for plant in swayed]
    return {"heads": [*heads, "young people"], "rows": rows, "seconds": f"{found.end - found.start:.3g}"}


def _cycle_sentence(case: CaseRuns) -> str:
    prediction = case.prediction
    if not prediction.cycle:
        return "No cycle is predicted without noise."
    return (
        f"Without noise, the predicted cycle has Δ_crit = {numbers.number(prediction.delta_crit)} s and a period of "
        f"{numbers.number(prediction.period)} s; its orbit is {prediction.verdict}."
    )


def summary(cases: Sequence[CaseRuns]) -> Section:
    """Paper, prediction, linear plant and MuJoCo side by side."""
    return Section(
        "summary",
        "Summary",
        "summary.html.j2",
        {
            "rows": [_summary_row(case) for case in cases],
            "errors": _error_rows(cases),
            "paper": any(_has_published_values(case) for case in cases),
        },
    )


def _has_published_values(case: CaseRuns) -> bool:
    paper = case.first.run.case.paper
    return any(value is not None for value in (paper.delta_crit, paper.eigenvalue, paper.cycle))


def abstract(cases: Sequence[CaseRuns]) -> str:
    """The headline in one paragraph."""
    expected = [case for case in cases if case.prediction.cycle and not is_noisy(case)]
    driven = [case for case in cases if is_noisy(case)]
    parts = [
        "Under event-driven intermittent control, a plant can settle on a limit cycle if the controller’s model of the "
        "plant is wrong."
    ]
    if len(cases) == 1:
        return " ".join([*parts, *_describe_tests(cases)])
    parts.append(
        f"Of the {count(len(cases) - len(driven), 'case')} {'without noise ' if driven else ''}below, linear theory "
        f"predicts a limit cycle for {len(expected)}."
    )
    for plant in ("linear", "mujoco"):
        found = [case.comparisons[plant] for case in expected if plant in case.comparisons]
        settled = [comparison for comparison in found if comparison.measured.converged]
        if not found:
            continue
        worst = max((abs(c.relative_error.interval or 0.0) for c in settled), default=None)
        where = "On the linear plant" if plant == "linear" else "In MuJoCo"
        many = "all of them are" if len(settled) == len(found) else f"{len(settled)} of {len(found)} are"
        accuracy = (
            "" if worst is None else f", with a relative error of the interval of at most {numbers.number(worst, 2)}"
        )
        parts.append(f"{where} {many} reached{accuracy}.")
    rest = [case for case in cases if not case.prediction.cycle and not is_noisy(case)]
    unpredicted = sum(any(c.measured.kind == "cycle" for c in case.comparisons.values()) for case in rest)
    if unpredicted:
        where = count(unpredicted, "other case")
        parts.append(f"In {where} a run settles on a cycle although linear theory predicts none.")
    return " ".join([*parts, *_describe_tests(cases)])


def _describe_tests(cases: Sequence[CaseRuns]) -> list[str]:
    """How many of the paper's results these cases test, and how many hold; nothing if they test none."""
    answers = verdicts_on_results(cases)
    if not answers:
        return []
    results = sum(statement.result for statement in STATEMENTS)
    of = "all of them" if len(answers) == results else f"{len(answers)} of them"
    kept, reserved, failed = (answers.count(verdict) for verdict in get_args(Verdict))
    return [
        f"Gawthrop (2017) lists {len(STATEMENTS)} statements, {results} of which are results; the others name the "
        f"system, or what a panel shows. These runs test {of}: {kept} are reproduced without and {reserved} with a "
        f"reservation, {failed} not."
    ]


def critical(case: CaseRuns, figures: int = 5) -> str:
    """Δ_crit [s], in brackets where no cycle is predicted; a dash under noise, where it would predict nothing then."""
    if case.prediction.cycle or case.prediction.delta_crit is None:
        return numbers.number(case.prediction.delta_crit, figures)
    return numbers.MISSING if is_noisy(case) else f"({numbers.number(case.prediction.delta_crit, figures)})"


def agrees_with_paper(case: CaseRuns) -> bool | None:
    """Whether Δ_crit rounds to the value that the paper prints; ``None`` where it prints none."""
    printed, found = case.first.run.case.paper.delta_crit, case.prediction.paper
    if printed is None:
        return None
    digits = len(repr(printed).partition(".")[2])
    return found is not None and abs(found.delta - printed) <= 0.5 * 10**-digits * (1 + 1e-9)


def _summary_row(case: CaseRuns) -> dict[str, Any]:
    paper, prediction, changes = case.first.run.case.paper, case.prediction, case.first.run.changes_in_words
    cells = {}
    for plant in ("linear", "mujoco"):
        comparison = case.comparisons.get(plant)
        mark, word, said = judge_run(comparison)
        cells[plant] = {
            "interval": numbers.MISSING if comparison is None else _interval(comparison),
            "error": _show_error(comparison),
            "mark": mark,
            "word": word,
            "said": said,
        }
    return {
        "title": case.first.run.title,
        "anchor": case.name,
        "paper": {
            "delta": numbers.MISSING if paper.delta_crit is None else f"{paper.delta_crit:g}",
            "eigenvalue": numbers.MISSING
            if paper.eigenvalue is None
            else numbers.eigenvalue(complex(paper.eigenvalue)),
            "cycle": _cycle_word(paper.cycle),
        },
        "predicted": {
            "delta": critical(case),
            "eigenvalue": numbers.eigenvalue(None if critical(case) == numbers.MISSING else prediction.eigenvalue),
            "cycle": _cycle_word(prediction.cycle),
            "verdict": prediction.verdict,
            "agrees": agrees_with_paper(case),
        },
        "runs": cells,
        "verdicts": [
            *([changes] if changes else ()),
            *_departures(case),
            *_by_paper(case),
            *verdicts(case),
            *_notices(case),
        ],
    }


def _cycle_word(there: bool | None) -> str:
    return numbers.MISSING if there is None else "yes" if there else "none"


def _by_paper(case: CaseRuns) -> list[str]:
    """What the paper's condition says, where that is not what the orbits say."""
    if case.prediction.by_paper == case.prediction.cycle:
        return []
    return [f"By the paper's condition: {'a limit cycle' if case.prediction.by_paper else 'no limit cycle'}."]


def _departures(case: CaseRuns) -> list[str]:
    paper, prediction = case.first.run.case.paper, case.prediction
    if agrees_with_paper(case) is not False:
        return []
    computed = "undefined" if prediction.paper is None else f"{numbers.number(prediction.paper.delta)} s"
    return [f"Differs from the paper: Δ_crit is {computed}; the paper has {paper.delta_crit:g} s."]


def _notices(case: CaseRuns) -> list[str]:
    """Notices on plants and runs without repetition, with the plant where a notice does not hold for every run."""
    of = {plant: comparison.notices for plant, comparison in case.comparisons.items()}
    every = list(dict.fromkeys(notice for notices in of.values() for notice in notices))
    words = []
    for notice in every:
        where = [plant for plant, notices in of.items() if notice in notices]
        words.append(notice_in_words(notice, "" if len(where) == len(of) else NAME[where[0]]))
    return words


def _show_error(comparison: Comparison | None) -> str:
    if comparison is None or comparison.relative_error.interval is None or comparison.measured.kind == "noisy":
        return ""
    return numbers.error(comparison.relative_error.interval)


def _interval(comparison: Comparison) -> str:
    if comparison.measured.kind == "homoclinic":
        return "grows"
    return numbers.number(comparison.measured.interval, 5)


def _error_rows(cases: Sequence[CaseRuns]) -> list[dict[str, Any]]:
    rows = []
    for case in cases:
        for plant, comparison in case.comparisons.items():
            if not comparison.predicted.cycle or is_noisy(case):
                continue
            e = comparison.relative_error
            names = case.first.actual.outputs
            amplitude = "not on a cycle"
            if e.amplitude is not None:
                amplitude = "; ".join(
                    f"{name}\N{NO-BREAK SPACE}{numbers.error(value)}" if len(names) > 1 else numbers.error(value)
                    for name, value in zip(names, e.amplitude, strict=True)
                )
            rows.append(
                {
                    "title": case.first.run.title,
                    "span": len(case.runs) if plant == next(iter(case.runs)) else 0,
                    "plant": NAME[plant],
                    "interval": numbers.error(e.interval),
                    "period": numbers.error(e.period),
                    "amplitude": amplitude,
                    "gamma": numbers.error(e.gamma),
                    "mark": numbers.mark(comparison.measured.converged),
                }
            )
    return rows


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
