"""The section of settings: those of the runs, their precision and their provenance."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from icmj.base import numbers
from icmj.case.result import Result
from icmj.controller.design import Design, output_weight
from icmj.report.case_runs import CaseRuns
from icmj.report.material import Material
from icmj.report.notation import symbol
from icmj.report.section import Section
from icmj.report.style import NAME

WIDE = 9  # facts of the integration that have a column each
MANY = 3  # number of runs from which shared facts are listed once
POWER = re.compile(r"\b\d(?:\.\d+)?e[-+]\d+\b")  # a number as Python writes it


def compose(material: Material) -> Section | None:
    """What the paper does not print and was chosen here, how the runs were integrated, and where they come from."""
    if not (cases := material.cases):
        return None
    rules = [case.controller.trigger.facts() for case in cases]
    keys = list(dict.fromkeys(key for rule in rules for key in rule))
    rows = []
    for case, rule in zip(cases, rules, strict=True):
        run, controller = case.first.run, case.controller
        rows.append(
            {
                "title": run.title,
                "changes": run.changes_in_words,
                "rule": [rule_fact(rule.get(key), controller.design) for key in keys],
                "hold": controller.hold.name,
                "duration": numbers.short(run.simulation.duration),
                "initial": numbers.setting(run.simulation.settings().initial),
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
        TEMPLATE,
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
        plain, rows = [key.replace("_", " ") for key in keys], []
        for case, simulation in runs:
            facts = [_fact(simulation.precision.get(key)) for key in keys]
            if len(keys) > WIDE:  # what a page is not wide enough for, in words
                pairs = zip(plain, facts, strict=True)
                facts = ["; ".join(f"{key} {fact}" for key, fact in pairs if fact != numbers.MISSING)]
            rows.append([case.first.run.title, *facts, simulation.outcome.kind])
        if rows:
            words = ", ".join(f"{key.replace('_', ' ')} {fact}" for key, fact in shared.items())
            columns = ["integration"] if len(keys) > WIDE else plain
            tables.append({"plant": name, "keys": columns, "rows": rows, "shared": words})
    return tables


def _fact(value: object) -> str:
    if isinstance(value, float):
        return numbers.short(value, 3)
    if value is None:
        return numbers.MISSING
    return POWER.sub(lambda found: numbers.short(float(found[0]), 2), str(value))


def _provenance(cases: Sequence[CaseRuns]) -> list[tuple[str, str]]:
    """Facts that all logs share once; others as the distinct values."""
    results = [result for case in cases for result in case.runs.values()]
    keys = dict.fromkeys(key for result in results for key in result.provenance)
    return [(key.replace("_", " "), _values(key, results)) for key in keys]


def _values(key: str, results: Sequence[Result]) -> str:
    values = list(dict.fromkeys(str(r.provenance[key]) for r in results if key in r.provenance))
    if key == "date" and len(values) > 1:
        return f"{min(values)} to {max(values)}"
    return ", ".join(values)


TEMPLATE = """\
{% from "macros.html.j2" import stack %}
<div class="wide"><table class="stack">
<caption><b>Table {{ next_table() }}.</b> Settings, in SI units, angles in radians. Event rule: {{ "Q_t"|notation }}, weight of the hold error; {{ "q_t"|notation }}, threshold; {{ "Δ_min"|notation }}, shortest interval. LQ (linear-quadratic) weights: {{ "R_c"|notation }} of the input in the state feedback, {{ "R_o"|notation }} of the measurement noise in the observer. Event rule, initial state and duration were chosen for this study; the paper does not print them.</caption>
<thead><tr><th scope="col">Case</th>{% for key in c.rule %}<th scope="col">{{ key|notation }}</th>{% endfor %}<th scope="col">Hold</th><th scope="col">Duration</th><th scope="col">Initial state</th><th scope="col">LQ weights</th></tr></thead>
<tbody>
{% for row in c.rows %}
<tr><th scope="row">{{ row.title }}</th>{% for fact in row.rule %}<td data-label="{{ c.rule[loop.index0] }}">{{ fact }}</td>{% endfor %}<td data-label="Hold">{{ row.hold|replace('-', '‑') }}</td><td data-label="Duration">{{ row.duration }}</td><td data-label="Initial state">{{ row.initial }}</td><td data-label="LQ weights"><span>{{ row.weights|notation }}</span></td></tr>
{% endfor %}
</tbody></table></div>
{% for row in c.rows if row.changes %}
<p>{{ row.title }}. {{ row.changes }}</p>
{% endfor %}
{% for table in c.precision %}
<div class="wide"><table class="stack">
<caption><b>Table {{ next_table() }}.</b> Integration and outcome of each {{ table.plant }} run{% if table.shared %}; common to all: {{ table.shared }}{% endif %}. SI units.</caption>
{{ stack(["Case"] + table["keys"] + ["outcome"], table.rows) }}
{% endfor %}
{% if c.provenance %}
<h3>Provenance</h3>
<dl>
{% for key, value in c.provenance %}
<dt>{{ key }}</dt><dd>{{ value }}</dd>
{% endfor %}
</dl>
{% endif %}
"""  # noqa: E501
