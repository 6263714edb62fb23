"""The headline: one sentence on what was predicted, what was measured, and whether they agree."""

from __future__ import annotations

from collections.abc import Sequence

from icmj.base import numbers
from icmj.base.numbers import count
from icmj.case.quantity import quantities
from icmj.case.result import Result
from icmj.report.case_runs import CaseRuns, is_noisy
from icmj.report.judgement import verdicts
from icmj.report.wording import describe_sway, kind_in_words, list_rms

NAMED = 3  # cases without a predicted cycle that the first sentence names


def headline(cases: Sequence[CaseRuns], others: Sequence[Result] = ()) -> str:
    """One sentence: predicted, measured, agreement; of controllers without a prediction, what they did."""
    if not cases:
        return others[0].words if len(others) == 1 else _describe_hold(others)
    if len(cases) == 1:
        return _single(cases[0])
    expected = [case for case in cases if case.prediction.cycle and not is_noisy(case)]
    quiet = [case for case in cases if not is_noisy(case)]
    said = count(len(quiet), "case") + (" without noise" if len(quiet) < len(cases) else "")
    if not expected:
        return f"Linear theory predicts a limit cycle in none of {said}."
    found = [case.comparisons[case.last.simulation.plant] for case in expected]
    settled = [comparison for comparison in found if comparison.measured.converged]
    worst = max((abs(c.relative_error.interval or 0.0) for c in settled), default=0.0)
    plants = {case.last.simulation.plant for case in expected}
    who = {"mujoco": "the bodies simulated in MuJoCo settle", "linear": "the simulated linear plants settle"}
    subject = who[plants.pop()] if len(plants) == 1 else "the simulated plants settle"
    many = "all of them" if len(settled) == len(found) else f"{len(settled)} of them"
    close = f", at intervals within {_percent(worst)} of the predicted ones" if settled else ""
    first = f"Linear theory predicts a limit cycle in {len(expected)} of {said}; {subject} on {many}{close}"
    rest = [case for case in quiet if not case.prediction.cycle]
    if not rest:
        agree = "prediction and measurement agree"
        return f"{first}: {agree if len(settled) == len(found) else f'{len(found) - len(settled)} do not agree'}."
    return f"{first}. {_without_prediction(rest)}"


def _without_prediction(cases: Sequence[CaseRuns]) -> str:
    """What the plant drawn last does where no cycle is predicted."""
    last = {case: case.comparisons[case.last.simulation.plant].measured for case in cases}
    on_cycle = [case for case, measured in last.items() if measured.kind == "cycle"]
    if not on_cycle:
        return "Where it predicts none, none is reached."
    subject = (
        "the body in MuJoCo settles" if on_cycle[0].last.simulation.plant == "mujoco" else "the linear plant settles"
    )
    if len(on_cycle) > NAMED:
        what = f"on a cycle in {len(on_cycle)} of {count(len(cases), 'case')}"
        return f"Where it predicts none, {subject} {what}."
    each = [
        f"every {numbers.number(last[case].interval, 3)} s on average for “{case.first.run.title}”" for case in on_cycle
    ]
    others = len(cases) - len(on_cycle)
    more = f"; in {count(others, 'other case')} it settles on none" if others else ""
    return f"Where it predicts none, {subject} on another cycle, with events {' and '.join(each)}{more}."


def _single(case: CaseRuns) -> str:
    prediction, comparison = case.prediction, case.comparisons[case.last.simulation.plant]
    sway = describe_sway(case.last)
    if not prediction.cycle or is_noisy(case):
        return f"{' '.join(verdicts(case))} {sway}".strip()
    delta, plant = numbers.number(comparison.predicted.delta_crit), comparison.plant
    said = (
        f"Linear theory predicts a limit cycle with an open-loop interval of {delta} s; "
        f"the run {'in MuJoCo' if plant == 'mujoco' else 'of the linear plant'} "
    )
    if comparison.measured.converged:
        close = _percent(abs(comparison.relative_error.interval or 0.0))
        said += f"settles on it, with an interval within {close} of the predicted one"
        return f"{said}: prediction and measurement agree. {_falls(case)}{sway}".strip()
    return f"{said}does not settle on it. {' '.join(verdicts(case))} {sway}".strip()


def _falls(case: CaseRuns) -> str:
    """From how many of the starts of the search for attractors the linear plant falls, in words; empty if from none."""
    found = () if case.linear is None else case.linear.attractors
    fallen = sum(each.count for each in found if each.measurement.kind == "growth")
    tried = sum(each.count for each in found)
    return f"From {fallen} of {tried} other starts the linear plant falls. " if fallen else ""


def _describe_hold(others: Sequence[Result]) -> str:
    """How runs without a prediction ended, and how large the sway of the last one of each case was."""
    stood = sum(run.simulation.outcome.kind == "completed" for run in others)
    kinds = ", ".join(dict.fromkeys(map(kind_in_words, others)))
    last = {run.run.case.name: run for run in others}
    sizes = "; ".join(f"{f'{run.run.title}, ' * (len(last) > 1)}{_describe_rms(run)}" for run in last.values())
    many = f"{stood} of {len(others)} runs"
    if stood == len(others):
        many = "Both runs" if stood == 2 else f"All {stood} runs"
    return f"{many} under {kinds} control ran to the end, with these RMS values in the second half: {sizes}."


def _percent(error: float) -> str:
    return "10⁻¹² %" if error < 1e-14 else f"{numbers.number(100 * error, 2)} %"


def _describe_rms(run: Result) -> str:
    """RMS of every output over the second half of the run, with its unit."""
    units = (shown.unit.replace("deg", "°") for shown in quantities(run.actual))
    each = zip(run.actual.outputs, list_rms(run), units, strict=True)
    return ", ".join(
        f"{name} {value}{'' if unit.startswith('°') else ' '}{unit}".rstrip() for name, value, unit in each
    )
