"""The sections of the page: each a heading, a template and the facts that the template prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from icmj.comparison import Comparison
from icmj.linear_plant import Array, LinearPlant
from icmj.report import numbers
from icmj.report.pairing import CaseRuns
from icmj.report.statements import STATEMENTS, answered, differences, untested
from icmj.report.style import NAME


@dataclass(frozen=True)
class Picture:
    """A drawn figure: its file name without suffix, its SVG as a data URI, and its words for who cannot see it."""

    name: str
    uri: str
    alt: str


@dataclass(frozen=True)
class Section:
    """One section of the page.

    Attributes:
        anchor: its id in the page.
        title: heading.
        template: file name in ``templates``.
        context: what the template prints.
    """

    anchor: str
    title: str
    template: str
    context: Mapping[str, Any] = field(default_factory=dict)


def summary(cases: Sequence[CaseRuns]) -> Section:
    """Paper, prediction, linear plant and MuJoCo side by side."""
    return Section(
        "summary",
        "Summary",
        "summary.html.j2",
        {"rows": [_summary_row(case) for case in cases], "errors": _error_rows(cases)},
    )


def abstract(cases: Sequence[CaseRuns]) -> str:
    """The headline in one paragraph."""
    expected = [case for case in cases if case.prediction.cycle]
    parts = [
        "Event-driven intermittent control makes a plant settle into a limit cycle when the controller’s model of it "
        f"is wrong. Of the {_count(len(cases), 'case')} below, the linear eigen-analysis predicts a limit cycle for "
        f"{len(expected)}."
    ]
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
    answers = [item.answer.verdict for item in answered(cases)]
    if answers:
        kept = answers.count("reproduced")
        reserved = answers.count("reproduced with a reservation")
        failed = answers.count("not reproduced")
        parts.append(
            f"Put to these runs, the paper’s statements on its figures give {_count(len(answers), 'answer')}: {kept} "
            f"reproduced, {reserved} reproduced with a reservation, {failed} not reproduced."
        )
    return " ".join(parts)


def statements(cases: Sequence[CaseRuns]) -> Section:
    """Every statement of the paper's section "Features to note", answered."""
    groups: dict[str, dict[str, Any]] = {}
    for item in answered(cases):
        paper = item.case.first.run.case.paper
        group = groups.setdefault(
            item.case.name,
            {"title": item.case.first.run.case.title, "note": paper.note, "figure": paper.figure, "items": []},
        )
        group["items"].append(item)
    extra = [{"title": case.first.run.case.title, "note": _note(case)} for case in cases if case.name not in groups]
    return Section(
        "statements",
        "The paper’s statements",
        "statements.html.j2",
        {
            "groups": list(groups.values()),
            "extra": extra,
            "untested": untested(cases),
            "total": len(STATEMENTS),
            "differences": differences(cases),
        },
    )


def figures(cases: Sequence[CaseRuns], pictures: Mapping[str, Mapping[str, Picture]]) -> Section:
    """The six panels of each case."""
    return Section(
        "figures",
        "The six panels of each case",
        "figures.html.j2",
        {
            "cases": [
                {
                    "name": case.name,
                    "title": case.first.run.case.title,
                    "panels": [
                        {"letter": letter, "picture": picture, "caption": _panel_caption(case, letter)}
                        for letter, picture in pictures[case.name].items()
                    ],
                    "caption": _figure_caption(case),
                    "verdicts": _verdicts(case),
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
                    "title": result.run.case.title,
                    "number": first_number + len(items),
                    "picture": pictures[case.name],
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


def designs(cases: Sequence[CaseRuns]) -> Section:
    """Assumed plants with their designs, and the actual plants."""
    blocks: list[tuple[Any, dict[str, Any]]] = []
    for case in cases:
        design = case.first.controller.design
        key = [design.plant.A, design.plant.B, design.plant.C, design.k, design.L]
        block = next((b for k, b in blocks if _same(k, key)), None)
        if block is None:
            block = {
                "states": design.plant.states,
                "inputs": design.plant.inputs,
                "outputs": design.plant.outputs,
                "matrices": [*_matrices(design.plant, "̂"), matrix("k̂", design.k), matrix("L", design.L)],
                "open_poles": numbers.poles(design.plant.poles),
                "controller_poles": numbers.poles(_sorted_eigenvalues(design.A_c)),
                "observer_poles": numbers.poles(_sorted_eigenvalues(design.A_o)),
                "cases": [],
            }
            blocks.append((key, block))
        block["cases"].append(case.first.run.case.title)
    plants = [
        {
            "title": case.first.run.case.title,
            "poles": numbers.poles(case.first.actual.poles),
            "state_feedback": case.prediction.state_feedback_stable,
            "observer_feedback": case.prediction.observer_feedback_stable,
            "matrices": _matrices(case.first.actual, ""),
        }
        for case in cases
    ]
    return Section(
        "design", "Design and linearisation", "design.html.j2", {"blocks": [b for _, b in blocks], "plants": plants}
    )


def settings(cases: Sequence[CaseRuns]) -> Section:
    """What the paper does not print and was chosen here, how the runs were integrated, and where they come from."""
    rows = []
    for case in cases:
        run = case.first.run
        rows.append(
            {
                "title": run.case.title,
                "q_t": numbers.short(run.controller.q_t),
                "Q_t": numbers.setting(run.controller.Q_t),
                "delta_min": numbers.short(run.controller.delta_min),
                "hold": run.controller.hold,
                "duration": numbers.short(run.simulation.duration),
                "initial": numbers.setting(run.simulation.initial),
                "weights": f"R_c = {numbers.setting(run.design.R_c)}, R_o = {numbers.setting(run.design.R_o)}",
            }
        )
    return Section(
        "settings",
        "Settings and provenance",
        "settings.html.j2",
        {"rows": rows, "precision": _precision(cases), "provenance": _provenance(cases)},
    )


def matrix(name: str, values: Array) -> dict[str, Any]:
    """A matrix as the template draws it."""
    return {"name": name, "rows": [[numbers.short(float(v), 4) for v in row] for row in np.atleast_2d(values)]}


def _note(case: CaseRuns) -> str:
    """The run file's note on a case that the paper does not have, and what its runs say beyond the prediction."""
    parts = [case.first.run.case.paper.note or "Not in the paper.", *_verdicts(case)]
    if case.prediction.delta_crit is None and case.mujoco is not None and case.mujoco.measurement.kind == "cycle":
        parts.append(
            "The controller’s model is exact for the linear plant only: for MuJoCo’s plant its linearity is a small "
            "error, which ends the growth of the intervals."
        )
    return " ".join(parts)


def _summary_row(case: CaseRuns) -> dict[str, Any]:
    paper, prediction = case.first.run.case.paper, case.prediction
    cells = {}
    for plant in ("linear", "mujoco"):
        comparison = case.comparisons.get(plant)
        expected = None if comparison is None else comparison.measured.converged
        cells[plant] = {
            "interval": numbers.MISSING if comparison is None else _interval(comparison),
            "error": _shown_error(comparison),
            "mark": numbers.mark(expected),
            "said": {None: "not run", True: "settles on the predicted cycle", False: "no predicted cycle reached"}[
                expected
            ],
        }
    return {
        "title": case.first.run.case.title,
        "anchor": case.name,
        "paper": {
            "delta": numbers.MISSING if paper.delta_crit is None else f"{paper.delta_crit:g}",
            "eigenvalue": numbers.MISSING
            if paper.eigenvalue is None
            else numbers.eigenvalue(complex(paper.eigenvalue)),
            "cycle": numbers.mark(paper.cycle),
        },
        "predicted": {
            "delta": numbers.number(prediction.delta_crit, 5),
            "eigenvalue": numbers.eigenvalue(prediction.eigenvalue),
            "cycle": numbers.mark(prediction.cycle),
            "verdict": prediction.verdict,
            "agrees": agrees_with_paper(case),
        },
        "runs": cells,
        "verdicts": [*_departures(case), *_verdicts(case)],
    }


def agrees_with_paper(case: CaseRuns) -> bool | None:
    """Whether Δ_crit rounds to the value that the paper prints; ``None`` where it prints none."""
    printed, computed = case.first.run.case.paper.delta_crit, case.prediction.delta_crit
    if printed is None:
        return None
    digits = len(repr(printed).partition(".")[2])
    return computed is not None and abs(computed - printed) <= 0.5 * 10**-digits * (1 + 1e-9)


def _departures(case: CaseRuns) -> list[str]:
    paper, prediction = case.first.run.case.paper, case.prediction
    if agrees_with_paper(case) is not False:
        return []
    computed = "undefined" if prediction.delta_crit is None else f"{numbers.number(prediction.delta_crit)} s"
    return [f"Departs from the paper: Δ_crit is {computed}, not {paper.delta_crit:g} s."]


def _shown_error(comparison: Comparison | None) -> str:
    if comparison is None or comparison.relative_error.interval is None:
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
            if not comparison.predicted.cycle:
                continue
            e = comparison.relative_error
            names = case.first.actual.outputs
            amplitude = "not on a cycle"
            if e.amplitude is not None:
                amplitude = "; ".join(
                    f"{name} {numbers.error(value)}" if len(names) > 1 else numbers.error(value)
                    for name, value in zip(names, e.amplitude, strict=True)
                )
            rows.append(
                {
                    "title": case.first.run.case.title,
                    "plant": NAME[plant],
                    "interval": numbers.error(e.interval),
                    "period": numbers.error(e.period),
                    "amplitude": amplitude,
                    "gamma": numbers.error(e.gamma),
                    "mark": numbers.mark(comparison.measured.converged),
                }
            )
    return rows


def _verdicts(case: CaseRuns) -> list[str]:
    """The verdict on both plants in one sentence where they agree, else one each."""
    words = {plant: comparison.words for plant, comparison in case.comparisons.items()}
    if len(words) == 2 and len(set(words.values())) == 1:
        return [f"Both plants: {_lower(next(iter(words.values())))}"]
    return [
        f"{NAME[plant].capitalize() if plant == 'linear' else NAME[plant]}: {_lower(text)}"
        for plant, text in words.items()
    ]


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


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


def _panel_caption(case: CaseRuns, letter: str) -> str:
    cycle, critical = case.prediction.cycle, case.prediction.delta_crit is not None
    several = len(case.first.actual.outputs) > 1
    match letter:
        case "a":
            return "Largest |λ| of φ against the clock-driven interval; points: growth measured in simulation."
        case "b":
            return "Eigenvalues of φ about the unit circle; shade and arrowheads show growing interval."
        case "c":
            band = " Pale: predicted range." if cycle else ""
            return f"Output{'s' if several else ''} under intermittent and continuous control; dotted: events.{band}"
        case "d":
            return "Velocity against position, latter part; circles: states at events."
        case "e":
            return "Open-loop interval that ends at each event" + ("; dotted: Δ_crit." if critical else ".")
        case _:
            if case.prediction.V_inv is None:
                return "Norm of x̄: without Δ_crit there is no V, hence no χ."
            return "Critical mode and norm of the others, latter part; dotted: events and ±γ."


def _matrices(plant: LinearPlant, hat: str) -> list[dict[str, Any]]:
    return [matrix(f"{name}{hat}", values) for name, values in (("A", plant.A), ("B", plant.B), ("C", plant.C))]


def _sorted_eigenvalues(A: Array) -> Array:
    values = np.linalg.eigvals(A).astype(complex)
    return values[np.lexsort((values.imag, -values.real))]


def _same(a: Sequence[Array], b: Sequence[Array]) -> bool:
    return all(x.shape == y.shape and np.allclose(x, y, rtol=1e-9, atol=1e-12) for x, y in zip(a, b, strict=True))


def _precision(cases: Sequence[CaseRuns]) -> list[dict[str, Any]]:
    """A table for each plant: one row a run, one column for each fact that any of its runs states."""
    tables = []
    for plant, name in NAME.items():
        runs = [(case, case.runs[plant].simulation) for case in cases if plant in case.runs]
        keys = list(dict.fromkeys(key for _, simulation in runs for key in simulation.precision))
        rows = [
            {
                "title": case.first.run.case.title,
                "outcome": simulation.outcome.kind,
                "facts": [_fact(simulation.precision.get(key)) for key in keys],
            }
            for case, simulation in runs
        ]
        if rows:
            tables.append({"plant": name, "keys": [key.replace("_", " ") for key in keys], "rows": rows})
    return tables


def _fact(value: object) -> str:
    if isinstance(value, float):
        return numbers.short(value, 3)
    return numbers.MISSING if value is None else str(value)


def _provenance(cases: Sequence[CaseRuns]) -> list[tuple[str, str]]:
    """Facts that all logs share once; others as the distinct values."""
    keys: list[str] = []
    results = [result for case in cases for result in case.runs.values()]
    for result in results:
        keys.extend(key for key in result.provenance if key not in keys)
    return [
        (
            key.replace("_", " "),
            ", ".join(dict.fromkeys(str(r.provenance[key]) for r in results if key in r.provenance)),
        )
        for key in keys
    ]


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"
