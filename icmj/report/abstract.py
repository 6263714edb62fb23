"""The abstract: the paragraph that says how many cases are tested, how many cycles are reached, and how closely."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from icmj.base import numbers
from icmj.base.numbers import count
from icmj.report.case_runs import CaseRuns, is_noisy
from icmj.report.statements import STATEMENTS, Verdict, verdicts_on_results


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
