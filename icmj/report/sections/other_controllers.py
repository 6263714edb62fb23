"""The section of runs without a prediction: how each ended, and its outputs and inputs over time."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base import numbers
from icmj.base.array import is_between
from icmj.case.quantity import in_unit, quantities, shared_unit
from icmj.case.result import Result
from icmj.report import style
from icmj.report.material import Material
from icmj.report.picture import Drawing
from icmj.report.section import Section
from icmj.report.style import NAME
from icmj.report.wording import kind_in_words, label_outputs, list_rms, notice_in_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LONGEST = 20.0  # s that are drawn, the last of the run: more is a smear


def compose(material: Material) -> Section | None:
    """A table of the runs, and a figure of each case, or ``None`` where there are none."""
    cases: dict[str, list[Result]] = {}
    for run in material.others:
        cases.setdefault(run.run.case.name, []).append(run)
    items = [
        {
            "title": same[0].run.title,
            "changes": same[0].run.changes_in_words,
            "picture": material.draw(
                Drawing(f"{name}_run", f"{same[0].run.title}, over time", partial(_draw_figure, same))
            ),
            "motion": material.other_motions.get(name),
            "facts": _controller_facts(same[0]),
            "outputs": [f"RMS {name}" for name in label_outputs(same[0].actual)],
            "rows": [_row(run) for run in same],
            "notices": list(map(notice_in_words, dict.fromkeys(notice for run in same for notice in run.notices))),
        }
        for name, same in cases.items()
    ]
    return Section("others", "Other controllers", TEMPLATE, {"items": items}) if items else None


def _controller_facts(run: Result) -> list[tuple[str, str]]:
    return [(key.replace("_", " "), numbers.setting(_show(value))) for key, value in run.controller.facts().items()]


def _row(run: Result) -> list[Any]:
    of = run.simulation
    return [NAME[of.plant], kind_in_words(run), of.outcome.message, len(of.events), *list_rms(run)]


def _show(value: Any) -> Any:
    return (value.item() if value.size == 1 else value.tolist()) if isinstance(value, np.ndarray) else value


def _draw_figure(runs: Sequence[Result]) -> Figure:
    """Every output of one case, and its inputs beneath, on each plant."""
    first = runs[0]
    shown = quantities(first.actual)
    figure, stack = style.new_figure(style.TALL, first.actual.n_y + 1)
    for run in runs:
        t, line, name = run.simulation.t, style.RUN[run.simulation.plant], style.NAME[run.simulation.plant]
        for i, axes in enumerate(stack[:-1]):
            axes.plot(t, shown[i].factor * run.simulation.y[:, i], label=name, **line)
            axes.set_ylabel(shown[i].label(style.words(first.actual.outputs[i])))
        for i in range(first.actual.n_u):
            stack[-1].plot(t, run.simulation.u[:, i], label=name if i == 0 else None, **line)
    end = max(float(run.simulation.t[-1]) for run in runs)
    for axes in stack:
        axes.set_xlim(max(0.0, end - LONGEST), end)
        drawn = [np.asarray(line.get_xydata(), dtype=float) for line in axes.get_lines()]
        late = np.concatenate([points[is_between(points[:, 0], end - LONGEST), 1] for points in drawn])
        low, high = float(late.min()), float(late.max())
        if np.isfinite(high - low) and high > low:
            axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    stack[-1].set(xlabel="time (s)", ylabel=in_unit("u", shared_unit(first.actual.input_units)))
    figure.align_ylabels(stack)
    style.link("time", *stack)
    style.legend(figure, stack[0])
    return figure


TEMPLATE = """\
{% from "macros.html.j2" import stack %}
<p>Critical intervals and cycles are predicted for the intermittent controller only; the table shows how each run ended. RMS is the root mean square over the second half of the run.</p>
{% if motions %}<p class="screen">Crimson: the instant that the moving body shows. Click or drag in a panel to choose another.</p>
{% endif %}
{% for item in c['items'] %}
<figure class="law">
<h3>{{ item.title }}</h3>
{% if item.changes %}<p class="changes">{{ item.changes }}</p>
{% endif %}{% if item.motion %}<div class="player" data-motion="{{ item.motion }}" hidden></div>
{% endif %}
<div class="panels">
<div class="panel"{% if item.picture.linked %} data-linked="{{ item.picture.linked }}"{% endif %}>{{ item.picture|drawn }}</div>
</div>
<div class="wide"><table class="stack">
{{ stack(["Plant", "Control", "The run …", "Switches"] + item.outputs, item.rows) }}
<figcaption><b>Figure {{ next_figure() }}.</b> {{ item.title }}: outputs and inputs over time on each plant. Controller: {% for key, value in item.facts %}{{ key }} {{ value }}{{ "; " if not loop.last else "." }}{% endfor %}{% for notice in item.notices %} {{ notice }}{% endfor %}</figcaption>
</figure>
{% endfor %}
"""  # noqa: E501
