"""The section of the paper's statements: each of them answered by the runs that are about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from icmj.report.case_runs import CaseRuns
from icmj.report.judgement import verdicts
from icmj.report.material import Material
from icmj.report.section import Section
from icmj.report.statements import STATEMENTS, answer, find_untested


def compose(material: Material) -> Section | None:
    """Every statement of the paper's section "Features to note", answered; ``None`` if no case is about the paper."""
    cases = material.cases
    if not any(map(_is_about_the_paper, cases)):
        return None
    groups: dict[str, dict[str, Any]] = {}
    for item in answer(cases):
        paper = item.case.first.run.case.paper
        group = groups.setdefault(
            item.case.name,
            {"title": item.case.first.run.title, "note": paper.note, "figure": paper.figure, "items": []},
        )
        group["items"].append(item)
    extra = [{"title": case.first.run.title, "note": _note(case)} for case in cases if case.name not in groups]
    context = {
        "groups": list(groups.values()),
        "extra": extra,
        "untested": find_untested(cases),
        "total": len(STATEMENTS),
        "differences": differences(cases),
    }
    return Section("statements", "The paper’s statements", TEMPLATE, context)


def _is_about_the_paper(case: CaseRuns) -> bool:
    paper = case.first.run.case.paper
    return bool(paper.figure or paper.note)


def _note(case: CaseRuns) -> str:
    """The run file's note on a case that the paper does not have, and what its runs say beyond the prediction."""
    return " ".join([case.first.run.case.paper.note or "Not in the paper.", *verdicts(case)])


@dataclass(frozen=True)
class Departure:
    """Where this project departs from the paper, and why; of what begins with ``figures`` among the paper's."""

    figures: str
    title: str
    text: str


def differences(cases: Sequence[CaseRuns]) -> list[Departure]:
    """The departures that concern these cases."""
    figures = {case.first.run.case.paper.figure for case in cases} - {""}
    return [one for one in DEPARTURES if any(figure.startswith(one.figures) for figure in figures)]


DEPARTURES = (
    Departure(
        "simple-neglected",
        "A probable misprint",
        "For the neglected dynamics the paper prints a damping ratio ζ = 0.5 (and omits a factor s next to "
        "it). With this value the recovered design has Δ_crit = 2.169 s and a stable A − Bk; the paper has "
        "3.6 s and an unstable A − Bk. With ζ = 0.1 both statements of the paper hold. Since the paper does "
        "not print its design, 0.5 is only probably a misprint. ζ = 0.1 is taken as the case of the paper, "
        "and ζ = 0.5 is shown in addition, “as printed”.",
    ),
    Departure(
        "three=",
        "The three-link plant is a calibration",
        "The paper takes its standing model from earlier work and prints none of its parameters. Here the "
        "segments are those of Winter (2009) for a person of 80 kg and 1.80 m; passive stiffness and damping "
        "of the joints were chosen to obtain both published intervals. It is not the author’s model.",
    ),
    Departure(
        "",
        "The design was recovered",
        "The paper prints no weights. One set of LQ weights was found by a search such that the intervals of "
        "its two second-order systems agree with the printed ones; it is used for all of them. These intervals "
        "therefore test the design less than the periods, the mirrored halves and the convergence do. The "
        "weights of the three-link system are part of its calibration.",
    ),
    Departure(
        "",
        "Choices of this study",
        "The paper does not print Q_t, q_t, Δ_min, initial states and durations either. Δ_crit does not depend "
        "on them; they determine the amplitude, and which attractor a run reaches.",
    ),
)


TEMPLATE = """\
{% if c.groups %}
<p>The paper lists the features of each of its figures (section “Features to note”). Each statement is paraphrased here and compared with the runs of the same case. A printed value counts as reproduced if the computed value rounds to it; a statement about a simulation, if both plants show it. Statements that only name the system, or what a panel shows, are marked “as described”.</p>
{% else %}
<p>None of these runs corresponds to a figure of the paper.</p>
{% endif %}
{% for group in c.groups %}
<h3>{{ group.title|notation }}</h3>
<ol class="statements">
{% for item in group['items'] %}
<li value="{{ item.statement.number }}"><p class="claim">{{ item.statement.text|notation }}</p>
<p class="answer"><span class="tag {{ item.answer.verdict.split(' ')[0] }}{{ ' reserved' if 'reservation' in item.answer.verdict }}">{{ {'reproduced': '✓', 'reproduced with a reservation': '(✓)', 'not reproduced': '✗'}.get(item.answer.verdict, '–') }} {{ item.answer.verdict if item.statement.result else item.answer.verdict|replace('reproduced', 'as described') }}</span> {{ item.answer.why|notation }}</p></li>
{% endfor %}
</ol>
{% if group.note %}<p class="note">{{ group.note|notation }}</p>{% endif %}
{% endfor %}
{% if c.extra %}
<h3>Cases beyond the paper’s figures</h3>
<ul>
{% for item in c.extra %}
<li><b>{{ item.title }}.</b> {{ item.note|notation }}</li>
{% endfor %}
</ul>
{% endif %}
{% if c.untested %}
<p class="note">{{ c.untested|length }} of the {{ c.total }} statements of the paper concern cases for which this report has no log.</p>
{% endif %}
{% if c.differences %}
<h3>What differs from the paper, and why</h3>
<ul>
{% for item in c.differences %}
<li><b>{{ item.title }}.</b> {{ item.text|notation }}</li>
{% endfor %}
</ul>
{% endif %}
"""  # noqa: E501
