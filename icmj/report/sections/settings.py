"""Designs and linearisations, settings, precision and provenance of the runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from icmj.base import numbers
from icmj.base.array import Array
from icmj.controller.design import Design
from icmj.controller.trigger import output_weight
from icmj.plant.linear_plant import LinearPlant
from icmj.report.notation import symbol
from icmj.report.pairing import CaseRuns
from icmj.report.sections.section import Section
from icmj.report.style import NAME
from icmj.result.result import Result

WIDE = 9  # facts of the integration that have a column each
MANY = 3  # number of runs from which shared facts are listed once


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


def matrix(name: str, values: Array) -> dict[str, Any]:
    """A matrix as the template draws it."""
    return {"name": name, "rows": [[numbers.short(float(v), 4) for v in row] for row in np.atleast_2d(values)]}


def _matrices(plant: LinearPlant, hat: str) -> list[dict[str, Any]]:
    return [matrix(f"{name}{hat}", values) for name, values in (("A", plant.A), ("B", plant.B), ("C", plant.C))]


def _sorted_eigenvalues(A: Array) -> NDArray[np.complex128]:
    values = np.linalg.eigvals(A).astype(complex)
    return values[np.lexsort((values.imag, -values.real))]


def _same(a: Sequence[Array], b: Sequence[Array]) -> bool:
    return all(x.shape == y.shape and np.allclose(x, y, rtol=1e-9, atol=1e-12) for x, y in zip(a, b, strict=True))


def settings(cases: Sequence[CaseRuns]) -> Section:
    """What the paper does not print and was chosen here, how the runs were integrated, and where they come from."""
    rules = [case.first.controller.trigger.facts() for case in cases]
    keys = list(dict.fromkeys(key for rule in rules for key in rule))
    rows = []
    for case, rule in zip(cases, rules, strict=True):
        run, controller = case.first.run, case.first.controller
        rows.append(
            {
                "title": run.case.title,
                "rule": [rule_fact(rule.get(key), controller.design) for key in keys],
                "hold": controller.hold.name,
                "duration": numbers.short(run.simulation.duration),
                "initial": numbers.setting(run.simulation.initial),
                "weights": ", ".join(
                    f"{weight} = {numbers.setting(getattr(run.design, weight))}"
                    if getattr(run.design, gain) is None
                    else f"{gain} given"
                    for weight, gain in (("R_c", "k"), ("R_o", "L"))
                ),
            }
        )
    return Section(
        "settings",
        "Settings and provenance",
        "settings.html.j2",
        {
            "rule": [symbol(key) for key in keys],
            "rows": rows,
            "precision": _precision(cases),
            "provenance": _provenance(cases),
        },
    )


def rule_fact(value: object, design: Design) -> str:
    """One setting of the event rule as text; a weight on the states in its shortest form."""
    if value is None:
        return numbers.MISSING
    if not isinstance(value, np.ndarray):
        return numbers.setting(value)
    if value.shape == (design.plant.n, design.plant.n):
        if np.array_equal(value, np.eye(len(value))):
            return "I"
        if np.allclose(value, output_weight(design), rtol=1e-12, atol=0):
            return "ĈᵀĈ"
        if np.array_equal(value, np.diag(np.diag(value))):
            return f"diag({', '.join(numbers.short(float(v)) for v in np.diag(value))})"
    return numbers.setting(value.tolist())


def _precision(cases: Sequence[CaseRuns]) -> list[dict[str, Any]]:
    """A table for each plant: a row for each run, a column for each fact; facts shared by many runs are above it."""
    tables = []
    for plant, name in NAME.items():
        runs = [(case, case.runs[plant].simulation) for case in cases if plant in case.runs]
        keys = list(dict.fromkeys(key for _, simulation in runs for key in simulation.precision))
        said = {key: {_fact(simulation.precision.get(key)) for _, simulation in runs} for key in keys}
        shared = {key: facts.pop() for key, facts in said.items() if len(runs) >= MANY and len(facts) == 1}
        keys = [key for key in keys if key not in shared]
        rows: list[dict[str, Any]] = [
            {
                "title": case.first.run.case.title,
                "outcome": simulation.outcome.kind,
                "facts": [_fact(simulation.precision.get(key)) for key in keys],
            }
            for case, simulation in runs
        ]
        if rows:
            words = ", ".join(f"{key.replace('_', ' ')} {fact}" for key, fact in shared.items())
            plain = [key.replace("_", " ") for key in keys]
            if len(plain) > WIDE:  # what a page is not wide enough for, in words
                for row in rows:
                    pairs = zip(plain, row["facts"], strict=True)
                    row["facts"] = ["; ".join(f"{key} {fact}" for key, fact in pairs if fact != numbers.MISSING)]
                plain = ["integration"]
            tables.append({"plant": name, "keys": plain, "rows": rows, "shared": words})
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
    return [(key.replace("_", " "), _values(key, results)) for key in keys]


def _values(key: str, results: Sequence[Result]) -> str:
    values = list(dict.fromkeys(str(r.provenance[key]) for r in results if key in r.provenance))
    if key == "date" and len(values) > 1:
        return f"{min(values)} to {max(values)}"
    return ", ".join(values)
