"""The figures: the panels of each case, and the amplitude law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from icmj.base import numbers
from icmj.report.pairing import CaseRuns
from icmj.report.sections.section import DrawnPanel, Picture, Section
from icmj.report.sections.wording import verdicts
from icmj.view.quantity import in_unit, threshold_unit


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
                    "title": case.first.run.case.title,
                    "motion": motions.get(case.name),
                    "panels": panels[case.name],
                    "caption": _figure_caption(case),
                    "given": _given(case),
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
                    "title": result.run.case.title,
                    "number": first_number + len(items),
                    "threshold": in_unit("Threshold", threshold_unit(result)),
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


def _given(case: CaseRuns) -> list[tuple[str, str]]:
    """The parameters of a case: body, model error, rule, delay, weights, start and duration."""
    result = case.first
    run, settings = result.run, result.run.simulation.settings()
    gain = run.actual.gain if isinstance(run.actual.gain, list) else [run.actual.gain]
    changes = [f"{change.what} {change.of or ''}".strip() for change in run.actual.change]
    delay = run.assumed.delay or 0.0
    rule = result.controller.trigger.facts()
    weights = ((name, getattr(run.design, name, None)) for name in ("R_c", "R_o"))
    found = [
        ("plant", run.actual_path.stem if run.on_engine else "matrices"),
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
