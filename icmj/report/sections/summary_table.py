"""The section that sums up: of each case what the paper has, what is predicted, and what each plant did."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from icmj.base import numbers
from icmj.case.comparison import Comparison
from icmj.report.case_runs import CaseRuns, is_noisy
from icmj.report.judgement import judge_run, verdicts
from icmj.report.material import Material
from icmj.report.section import Section
from icmj.report.style import NAME
from icmj.report.wording import notice_in_words


def compose(material: Material) -> Section | None:
    """Paper, prediction, linear plant and MuJoCo side by side."""
    if not (cases := material.cases):
        return None
    context = {
        "rows": [_summary_row(case) for case in cases],
        "errors": _error_rows(cases),
        "paper": any(_has_published_values(case) for case in cases),
    }
    return Section("summary", "Summary", TEMPLATE, context)


def _has_published_values(case: CaseRuns) -> bool:
    paper = case.first.run.case.paper
    return any(value is not None for value in (paper.delta_crit, paper.eigenvalue, paper.cycle))


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
    where = {notice: [plant for plant in of if notice in of[plant]] for notices in of.values() for notice in notices}
    return [notice_in_words(notice, "" if len(at) == len(of) else NAME[at[0]]) for notice, at in where.items()]


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


TEMPLATE = """\
{% from "macros.html.j2" import legend, mark %}
{% set paper %}{% if c.paper %}<th scope="col">paper</th>{% endif %}{% endset %}
<div class="wide">
<table class="summary stack">
<caption><b>Table {{ next_table() }}.</b> The critical open-loop interval {{ "Δ_crit"|notation }} and the interval {{ "Δ_ol"|notation }} at which each simulation settles, in seconds; {{ "λ_crit"|notation }} is the eigenvalue that reaches the unit circle at {{ "Δ_crit"|notation }}. In brackets: no cycle is predicted there. {% if c.paper %}Below the predicted value: whether it rounds to the value in the paper; below{% else %}Below{% endif %} the measured values: their relative error with respect to the prediction. Limit cycle: {% if c.paper %}whether the paper reports one, {% endif %}whether theory predicts one, and what each simulation did. ✓ agrees with the prediction; ○ a cycle that is not predicted; ✗ a predicted cycle is not reached.</caption>
<thead>
<tr><th rowspan="2" scope="col">Case</th><th colspan="{{ 4 if c.paper else 3 }}" scope="colgroup">Interval (s)</th><th{% if c.paper %} colspan="2"{% endif %} scope="colgroup">λ<sub>crit</sub></th><th colspan="{{ 4 if c.paper else 3 }}" scope="colgroup">Limit cycle</th></tr>
<tr>{{ paper }}<th scope="col">predicted</th><th scope="col">linear</th><th scope="col">MuJoCo</th>{{ paper }}<th scope="col">predicted</th>{{ paper }}<th scope="col">predicted</th><th scope="col">linear</th><th scope="col">MuJoCo</th></tr>
</thead>
{% for row in c.rows %}
<tbody>
<tr>
<th scope="row"><a href="#case-{{ row.anchor }}">{{ row.title }}</a></th>
{% if c.paper %}<td data-label="Interval, paper (s)">{{ row.paper.delta }}</td>
{% endif %}<td data-label="Interval, predicted (s)"><span>{{ row.predicted.delta }}{% if row.predicted.agrees is not none %}<small>{{ "= paper " if row.predicted.agrees else "≠ paper " }}{{ mark("✓" if row.predicted.agrees else "✗", "rounds to the printed value" if row.predicted.agrees else "departs from the printed value") }}</small>{% endif %}</span></td>
<td data-label="Interval, linear (s)"><span>{{ row.runs.linear.interval }}{% if row.runs.linear.error %}<small>{{ row.runs.linear.error }}</small>{% endif %}</span></td>
<td data-label="Interval, MuJoCo (s)"><span>{{ row.runs.mujoco.interval }}{% if row.runs.mujoco.error %}<small>{{ row.runs.mujoco.error }}</small>{% endif %}</span></td>
{% if c.paper %}<td data-label="λ, paper">{{ row.paper.eigenvalue }}</td>
{% endif %}<td data-label="λ, predicted">{{ row.predicted.eigenvalue }}</td>
{% if c.paper %}<td data-label="Cycle, paper">{{ row.paper.cycle }}</td>
{% endif %}<td data-label="Cycle, predicted"><span title="predicted orbit: {{ row.predicted.verdict }}">{{ row.predicted.cycle }}{% if row.predicted.cycle == "yes" %}<small>{{ row.predicted.verdict }}</small>{% endif %}</span></td>
<td data-label="Cycle, linear"><span>{{ mark(row.runs.linear.mark, row.runs.linear.said) }}<small class="word">{{ row.runs.linear.word }}</small></span></td>
<td data-label="Cycle, MuJoCo"><span>{{ mark(row.runs.mujoco.mark, row.runs.mujoco.said) }}<small class="word">{{ row.runs.mujoco.word }}</small></span></td>
</tr>
<tr class="verdict"><td colspan="{{ 11 if c.paper else 8 }}">{% for verdict in row.verdicts %}<span>{{ verdict|notation }}</span> {% endfor %}</td></tr>
</tbody>
{% endfor %}
</table>
</div>
{% if c.errors %}
<div class="wide">
<table class="stack">
<caption><b>Table {{ next_table() }}.</b> Relative errors (measured − predicted)/predicted where a cycle is predicted: open-loop interval, period, peak of each output over the cycle, and γ, the magnitude of the critical mode {{ "χ_k1"|notation }} at events.</caption>
<thead><tr><th scope="col">Case</th><th scope="col">Plant</th><th scope="col">Interval</th><th scope="col">Period</th><th scope="col">Amplitude</th><th scope="col">γ</th><th scope="col">Settled</th></tr></thead>
<tbody>
{% for row in c.errors %}
<tr>{% if row.span %}<th scope="row" rowspan="{{ row.span }}">{{ row.title }}</th>{% endif %}<td data-label="Plant">{{ row.plant }}</td><td data-label="Interval">{{ row.interval }}</td><td data-label="Period">{{ row.period }}</td><td data-label="Amplitude">{{ row.amplitude }}</td><td data-label="γ">{{ row.gamma }}</td><td data-label="Settled">{{ mark(row.mark, "settles on the predicted cycle") }}</td></tr>
{% endfor %}
</tbody>
</table>
</div>
{% endif %}
{{ legend(symbols) }}
"""  # noqa: E501
