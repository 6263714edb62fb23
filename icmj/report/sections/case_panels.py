"""The section of the panels: the pictures of each case with their captions, its parameters, and its verdict."""

from __future__ import annotations

from functools import partial

from icmj.base import numbers
from icmj.case.quantity import threshold_unit
from icmj.plant.person import Person
from icmj.report.case_runs import CaseRuns
from icmj.report.judgement import verdicts
from icmj.report.material import Material
from icmj.report.panel import Panel
from icmj.report.panels import PANELS
from icmj.report.picture import Drawing
from icmj.report.section import Section
from icmj.report.wording import describe_sway
from icmj.runfile.schema import RunFile


def compose(material: Material) -> Section | None:
    """The panels of each case."""
    cases = [
        {
            "name": case.name,
            "title": case.first.run.title,
            "changes": case.first.run.changes_in_words,
            "sway": describe_sway(case.last),
            "motion": material.case_motions.get(case.name),
            "panels": [
                {"letter": panel.letter, "picture": material.show(drawing), "caption": panel.caption(case)}
                for panel, drawing in _panels_of(case)
            ],
            "caption": _figure_caption(case),
            "given": _list_parameters(case),
            "verdicts": verdicts(case),
        }
        for case in material.cases
    ]
    if not cases:
        return None
    listed = tuple((f"case-{case.name}", case.first.run.title) for case in material.cases)
    return Section("figures", "The panels of each case", TEMPLATE, {"cases": cases}, listed)


def list_drawings(case: CaseRuns) -> list[Drawing]:
    """The panels that a case has."""
    return [drawing for _, drawing in _panels_of(case)]


def _panels_of(case: CaseRuns) -> list[tuple[Panel, Drawing]]:
    """The panels that a case has, and how they are drawn."""
    title, shown = case.first.run.title, (panel for panel in PANELS.collect("PANEL") if panel.applies(case))
    return [
        (panel, Drawing(f"{case.name}_{panel.letter}", f"{title}, panel ({panel.letter})", partial(panel.draw, case)))
        for panel in shown
    ]


def _list_parameters(case: CaseRuns) -> list[tuple[str, str]]:
    """The parameters of a case: body, model error, rule, delay, weights, start and duration."""
    result = case.first
    run, settings = result.run, result.run.simulation.settings()
    gain = run.actual.gain if isinstance(run.actual.gain, list) else [run.actual.gain]
    changes = [f"{change.what} {change.of or ''}".strip() for change in run.actual.changes]
    delay = run.assumed.delay or 0.0
    rule = case.controller.trigger.facts()
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
    kind = "one of a family" if prediction.verdict == "family" else f"its orbit {prediction.verdict}"
    return text + f"a limit cycle of period {period} s is predicted, {kind}."


TEMPLATE = """\
{% from "macros.html.j2" import legend %}
<p>The panels have the order and notation of the paper. The prediction is the broad, faint line; the linear plant is blue; MuJoCo is the thin red-brown line on top. Where they agree, the three lines coincide. Angles are in degrees.</p>
{% if motions %}<p class="screen">Crimson: the instant that the moving person shows, as a line over time and as a ring in the phase plane, where the path is that of the last part of the run alone. Click or drag in a panel over time to choose another; point at a panel to see the body at that instant.</p>
{% endif %}{{ legend(symbols) }}
{% for case in c.cases %}
<figure class="case">
<details{% if loop.first or c.cases|length < 3 %} open{% endif %}>
<summary><h3>{{ case.title|notation }}</h3><p>{{ case.verdicts|first|notation }}</p></summary>
<div class="opened" id="case-{{ case.name }}">
{% if case.changes %}<p class="changes">{{ case.changes }}</p>
{% endif %}{% if case.motion %}<div class="player" data-motion="{{ case.motion }}" hidden></div>
{% endif %}
<dl class="given" aria-label="Parameters">{% for name, value in case.given %}<div><dt>{{ name|notation }}</dt><dd>{{ value|notation }}</dd></div>{% endfor %}</dl>
<div class="panels">
{% for panel in case.panels %}
<div class="panel"{% if panel.picture.linked %} data-linked="{{ panel.picture.linked }}"{% endif %}>{{ panel.picture|drawn }}<p>({{ panel.letter }}) {{ panel.caption|notation }}</p></div>
{% endfor %}
</div>
<figcaption><b>Figure {{ next_figure() }}.</b> {{ case.title }}. {{ case.caption|notation }} {{ case.verdicts|join(" ")|notation }}{% if case.sway %} {{ case.sway|notation }}{% endif %}</figcaption>
</div>
</details>
</figure>
{% endfor %}
"""  # noqa: E501
