"""The sections of the page on single cases, each a function from the cases to a heading, a template and what it prints.

First comes what was predicted, what was measured and whether they agree, in one sentence and one figure; then the
panels of each case and the amplitude law; then controllers without a prediction, and several of one body side by side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from icmj.base import numbers
from icmj.base.array import is_between
from icmj.base.numbers import count
from icmj.case.quantity import in_unit, quantities, threshold_unit
from icmj.case.result import Attractor, Result
from icmj.measurement.sway import BEST_KNOWN
from icmj.plant.person import Person
from icmj.report.case_runs import CaseRuns
from icmj.report.designs import designs as designs
from icmj.report.designs import matrix as matrix
from icmj.report.judgement import verdicts
from icmj.report.noise_table import noise as noise
from icmj.report.rivals import Rival, kind_in_words
from icmj.report.run_settings import rule_fact as rule_fact
from icmj.report.run_settings import settings as settings
from icmj.report.section import DrawnPanel as DrawnPanel
from icmj.report.section import Picture as Picture
from icmj.report.section import Section as Section
from icmj.report.statements import statements as statements
from icmj.report.style import NAME
from icmj.report.summary import abstract as abstract
from icmj.report.summary import agrees_with_paper as agrees_with_paper
from icmj.report.summary import is_noisy
from icmj.report.summary import summary as summary
from icmj.report.wording import describe_sway, notice_in_words
from icmj.runfile.schema import RunFile

_RIVALS = (
    "Left: power spectra of the outputs over the second half of each run; right: rate of each output against its value "
    "over the last 20 s. Numbers are those of the table."
)


def others(
    runs: Sequence[Result],
    pictures: Mapping[str, Picture],
    first_number: int,
    motions: Mapping[str, str] = MappingProxyType({}),
) -> Section | None:
    """A table of the runs, and a figure of each case, or ``None`` where there are none.

    Args:
        runs: of any case, on any plant.
        pictures: outputs over time, by case.
        first_number: number of the first figure.
        motions: the script's names of runs, by case.
    """
    cases: dict[str, list[Result]] = {}
    for run in runs:
        cases.setdefault(run.run.case.name, []).append(run)
    items = [
        {
            "title": same[0].run.title,
            "changes": same[0].run.changes_in_words,
            "number": number,
            "picture": pictures[name],
            "motion": motions.get(name),
            "facts": _controller_facts(same[0]),
            "outputs": _outputs(same[0]),
            "rows": [_row(run) for run in same],
            "notices": list(map(notice_in_words, dict.fromkeys(notice for run in same for notice in run.notices))),
        }
        for number, (name, same) in enumerate(cases.items(), first_number)
    ]
    return Section("others", "Other controllers", "others.html.j2", {"items": items}) if items else None


def _controller_facts(run: Result) -> list[tuple[str, str]]:
    return [(key.replace("_", " "), numbers.setting(_show(value))) for key, value in run.controller.facts().items()]


def _outputs(run: Result) -> list[str]:
    return [
        shown.label(name).replace("deg", "°")
        for name, shown in zip(run.actual.outputs, quantities(run.actual), strict=True)
    ]


def rms_in_words(run: Result) -> str:
    """RMS of every output over the second half of the run, with its unit."""
    units = (shown.unit.replace("deg", "°") for shown in quantities(run.actual))
    each = zip(run.actual.outputs, _row(run)["rms"], units, strict=True)
    return ", ".join(
        f"{name} {value}{'' if unit.startswith('°') else ' '}{unit}".rstrip() for name, value, unit in each
    )


def _row(run: Result) -> dict[str, Any]:
    """RMS of every output over the second half of the run, weighted by time, and the outcome."""
    simulation, scale = run.simulation, np.array([shown.factor for shown in quantities(run.actual)])
    late = is_between(simulation.t, simulation.t[-1] / 2)
    t, y = simulation.t[late], simulation.y[late]
    length = float(t[-1] - t[0])
    with np.errstate(over="ignore", invalid="ignore"):
        rms = np.sqrt(np.trapezoid(y**2, t, axis=0) / length) if length > 0 else np.full(y.shape[1], np.nan)
    return {
        "plant": NAME[simulation.plant],
        "kind": kind_in_words(run),
        "end": simulation.outcome.message,
        "switches": len(simulation.events),
        "rms": [numbers.number(float(value), 3) for value in rms * scale],
    }


def _show(value: Any) -> Any:
    return (value.item() if value.size == 1 else value.tolist()) if isinstance(value, np.ndarray) else value


def rivals(found: Sequence[tuple[Sequence[Rival], tuple[Picture, Picture]]], first_number: int) -> Section | None:
    """A table and two pictures for each body, or ``None`` where none has several controllers.

    Args:
        found: the controllers of each body, with spectra and paths.
        first_number: number of the first figure.
    """
    items = [
        {
            "title": _of_group(group),
            "number": number,
            "pictures": pictures,
            "outputs": [f"{c.name} ({c.unit})".replace("deg", "°") for c in group[0].sway.coordinates],
            "rows": [_rival_row(n, rival) for n, rival in enumerate(group, 1)],
            "caption": _RIVALS,
        }
        for number, (group, pictures) in enumerate(found, first_number)
    ]
    return Section("controllers", "Controllers side by side", "rivals.html.j2", {"items": items}) if items else None


def _of_group(group: Sequence[Rival]) -> str:
    """Which controllers of one body these are, and on which plant."""
    kinds = [kind_in_words(rival.run) for rival in group]
    plant = "linear plant" if group[0].run.simulation.plant == "linear" else NAME[group[0].run.simulation.plant]
    return f"One body under {', '.join(kinds[:-1])} and {kinds[-1]} control, {plant}"


def _rival_row(number: int, rival: Rival) -> dict[str, Any]:
    simulation = rival.run.simulation
    late = simulation.events.t[is_between(simulation.events.t, simulation.t[-1] / 2)]
    return {
        "name": f"{number}. {rival.name}",
        "rate": numbers.number(len(late) / rival.sway.duration, 3),
        "outcome": simulation.outcome.kind,
        "measures": [tuple(numbers.number(c.number(key), 3) for key in BEST_KNOWN) for c in rival.sway.coordinates],
    }


CAPTION = (
    "Each row is a case. Broad bar: the open-loop interval Δ_crit that linear theory predicts, hollow where it "
    "predicts no cycle. Marks: the intervals Δ_ol between the last events of the simulated runs. A mark on its bar "
    "agrees with the prediction; the relative error shows how closely (the further left, the closer). {}"
)
ARROW = "Arrow: the intervals grow without bound. "
NOISE = "Line: mean and standard deviation of the intervals under noise. "
PLANT = "Linear plant: the body’s own equations, linearised at the pose in which it is balanced. "
NAMED = 3  # cases without a predicted cycle that the first sentence names
WORDS = "✓ agrees with the prediction; ○ a cycle that is not predicted; ✗ a predicted, attracting cycle is not reached."


def caption(cases: Sequence[CaseRuns]) -> str:
    """What the overview shows of these cases."""
    grows = any(c.measured.kind == "homoclinic" for case in cases for c in case.comparisons.values())
    linearised = any(case.linear is not None and case.first.run.on_engine for case in cases)
    return CAPTION.format(PLANT * linearised + ARROW * grows + NOISE * any(map(is_noisy, cases)) + WORDS)


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
    sizes = "; ".join(f"{f'{run.run.title}, ' * (len(last) > 1)}{rms_in_words(run)}" for run in last.values())
    many = f"{stood} of {len(others)} runs"
    if stood == len(others):
        many = "Both runs" if stood == 2 else f"All {stood} runs"
    return f"{many} under {kinds} control ran to the end, with these RMS values in the second half: {sizes}."


def _percent(error: float) -> str:
    return "10⁻¹² %" if error < 1e-14 else f"{numbers.number(100 * error, 2)} %"


def figures(
    cases: Sequence[CaseRuns],
    panels: Mapping[str, Sequence[DrawnPanel]],
    motions: Mapping[str, str] = MappingProxyType({}),
) -> Section:
    """The panels of each case; ``motions`` are the keys of their motions, by case."""
    return Section(
        "figures",
        "The panels of each case",
        "figures.html.j2",
        {
            "cases": [
                {
                    "name": case.name,
                    "title": case.first.run.title,
                    "changes": case.first.run.changes_in_words,
                    "sway": describe_sway(case.last),
                    "motion": motions.get(case.name),
                    "panels": panels[case.name],
                    "caption": _figure_caption(case),
                    "given": _list_parameters(case),
                    "verdicts": verdicts(case),
                }
                for case in cases
            ]
        },
    )


def law(cases: Sequence[CaseRuns], pictures: Mapping[str, Picture], first_number: int) -> Section | None:
    """The amplitude law, or ``None`` where no log holds one."""
    items: list[dict[str, Any]] = []
    for case in cases:
        result = next((r for r in reversed(case.runs.values()) if r.law is not None), None)
        if result is not None and result.law is not None:
            items.append(
                {
                    "title": result.run.title,
                    "number": first_number + len(items),
                    "threshold": in_unit("Threshold", threshold_unit(result)),
                    "picture": pictures[case.name],
                    "open": bool(np.isnan(result.law.interval_error).any()),
                    "interval_slope": f"{result.law.interval_slope:.3f}",
                    "amplitude_slope": f"{result.law.amplitude_slope:.3f}",
                    "rows": [
                        [numbers.short(q), numbers.error(i, signed=False), numbers.error(a, signed=False)]
                        for q, i, a in zip(
                            result.law.q_t, result.law.interval_error, result.law.amplitude_error, strict=True
                        )
                    ],
                }
            )
    return Section("law", "The amplitude law", "law.html.j2", {"items": items}) if items else None


def _list_parameters(case: CaseRuns) -> list[tuple[str, str]]:
    """The parameters of a case: body, model error, rule, delay, weights, start and duration."""
    result = case.first
    run, settings = result.run, result.run.simulation.settings()
    gain = run.actual.gain if isinstance(run.actual.gain, list) else [run.actual.gain]
    changes = [f"{change.what} {change.of or ''}".strip() for change in run.actual.changes]
    delay = run.assumed.delay or 0.0
    rule = result.controller.trigger.facts()
    weights = ((name, getattr(run.design, name, None)) for name in ("R_c", "R_o"))
    found = [
        ("plant", run.actual_path.stem if run.on_engine else "matrices"),
        *_persons(run),
        ("b", ", ".join(f"{value:g}" for value in gain)),
        ("changes", ", ".join(changes) or ("another model" if run.actual.model else "")),
        *((name, f"{value:g}") for name, value in rule.items() if name in ("q_t", "delta_min") and value),
        ("delay", f"{delay:g} s" if delay else ""),
        *((name, f"{value:g}") for name, value in weights if isinstance(value, int | float)),
        ("start", ", ".join(f"{name} {value:g}" for name, value in settings.initial.items())),
        ("duration", f"{settings.duration:g} s"),
    ]
    units = {"q_t": threshold_unit(result), "delta_min": "s"}
    names = {"delta_min": "Δ_min"}
    return [(names.get(name, name), f"{value} {units.get(name, '')}".strip()) for name, value in found if value]


def _persons(run: RunFile) -> list[tuple[str, str]]:
    """Height and mass of the person that the body is, and of the one that the controller assumes if it is another."""
    actual, assumed = run.actual_measures, run.assumed.measures

    def words(person: Person | None) -> str:
        return "that of the model file" if person is None else f"{person.height:g} m, {person.mass:g} kg"

    if actual == assumed:
        return [("person", words(actual))] if actual else []
    return [("person", words(actual)), ("assumed person", words(assumed))]


def _figure_caption(case: CaseRuns) -> str:
    prediction = case.prediction
    if prediction.delta_crit is None:
        return "No eigenvalue of φ(Δ) reaches ±1, so Δ_crit is undefined."
    delta, value = numbers.number(prediction.delta_crit, 5), numbers.eigenvalue(prediction.eigenvalue)
    text = f"Δ_crit = {delta} s with λ_crit = {value}; "
    if not prediction.cycle:
        return text + "no limit cycle is predicted."
    period = numbers.number(prediction.period, 5)
    return text + f"a limit cycle of period {period} s is predicted, its orbit {prediction.verdict}."


def motion(found: Attractor) -> str:
    """The motion in a few words."""
    measurement = found.measurement
    match measurement.kind:
        case "cycle":
            events = "1 event" if measurement.p == 1 else f"{measurement.p} events"
            return f"{'mirrored ' if measurement.mirrored else ''}cycle of {events}"
        case "homoclinic":
            return "intervals grow without bound"
        case "growth":
            return "grows without bound: a fall"
        case kind:
            return kind


def count_figures(section: Section | None) -> int:
    """How many figures a section of items has."""
    return 0 if section is None else sum(len(item["pictures"]) for item in section.context["items"])
