"""The summary: paper, prediction, linear plant and MuJoCo side by side, and the headline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

from icmj.base import numbers
from icmj.base.numbers import count
from icmj.case.comparison import Comparison
from icmj.report.case_runs import CaseRuns
from icmj.report.judgement import judge_run, verdicts
from icmj.report.section import Section
from icmj.report.statements import STATEMENTS, Verdict, verdicts_on_results
from icmj.report.style import NAME
from icmj.report.wording import notice_in_words


def is_noisy(case: CaseRuns) -> bool:
    """Whether noise acts in a case, so that no cycle can be reached in it."""
    return case.first.run.simulation.settings().noisy


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
