"""The page of an experiment: what it is of, what was found, its figure, its numbers with their uncertainty, methods."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np

from icmj.base.numbers import MISSING, count, number, readable
from icmj.report import style
from icmj.report.page import render_page
from icmj.report.picture import Picture
from icmj.report.section import Section

PLANTS = {"linear": "linear plant", "mujoco": "MuJoCo", "recording": "recorded"}
ROUNDING = 1e-9  # a share, or a relative scatter, below which there is nothing but rounding


@dataclass(frozen=True)
class Row:
    """The result of one case on one plant.

    Attributes:
        title, plant: of it.
        trials: how many.
        numbers: by name, with the unit in brackets.
        words: one sentence.
        deviations: standard deviations of numbers over trials.
    """

    title: str
    plant: str
    trials: int
    numbers: Mapping[str, float]
    words: str
    deviations: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Norms:
    """Numbers of others, which stand beside those that were found.

    Attributes:
        title: whose they are.
        trials: of how many trials.
        values: mean and standard deviation by the names of numbers; those that are not known are left out.
        words: where they are from.
    """

    title: str
    trials: int
    values: Mapping[str, tuple[float, float]]
    words: str


class Shown(Protocol):
    """What the page asks a kind of experiment (:class:`icmj.study.kind.Kind`)."""

    readable: ClassVar[bool]

    def caption(self, rows: Sequence[Row]) -> str: ...

    def methods(self, recorded: bool) -> str: ...

    def common(self, names: Sequence[str]) -> tuple[str, str]: ...

    def norms(self, names: Sequence[str]) -> Norms | None: ...


def experiment_page(
    title: str,
    kind: Shown,
    rows: Sequence[Row],
    svg: bytes | None,
    files: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> str:
    """The page's HTML.

    Args:
        title: of the experiment.
        kind: of the experiment.
        rows: the results.
        svg: the figure; ``None`` where nothing was found.
        files: names of recordings that were analysed; empty for simulated trials.
        notes: what was done to them, a line each.
    """
    recorded = all(row.plant == "recording" for row in rows)
    results: dict[str, Any] = {
        "picture": None if svg is None else Picture("figure", svg, f"{title}, figure"),
        "caption": kind.caption(rows),
        **_table(kind, rows, norms := kind.norms(_names(rows))),
    }
    methods = {"words": [kind.methods(recorded), _SAME, *((norms.words,) if norms else ()), *map(_end, notes)]}
    return render_page(
        [
            Section("results", "Results", _RESULTS, results),
            Section("methods", "Methods", _METHODS, methods),
        ],
        title=title,
        subtitle=_subtitle(rows, files),
        findings=_findings(rows),
        kicker="Experiment",
        source="recordings" if recorded else "the trials in the folder of this page",
        beside="The figure is also available as SVG and PNG files beside this page." if svg is not None else "",
    )


def _end(note: str) -> str:
    return note if note.endswith(".") else f"{note}."


def plant_name(plant: str) -> str:
    """The plant's name in words."""
    return style.NAME.get(plant, plant)


def _subtitle(rows: Sequence[Row], files: Sequence[str]) -> str:
    if all(row.plant == "recording" for row in rows):
        named = ", ".join(files[:3]) + (" …" if len(files) > 3 else "")
        return f"Recorded data: {count(sum(row.trials for row in rows), 'trial')}{f', from {named}' if files else ''}"
    cases, plants = list(dict.fromkeys(row.title for row in rows)), dict.fromkeys(PLANTS[row.plant] for row in rows)
    each = sorted({row.trials for row in rows})
    trials = f"{count(each[0], 'trial')} each" if len(each) == 1 else count(sum(row.trials for row in rows), "trial")
    where = f"{'on the' if 'linear plant' in plants else 'in'} {' and in '.join(plants)}"
    return f"Simulated data: {count(len(cases), 'case')} {where}, {trials}"


def _findings(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """A sentence for each case; one for both plants where they agree to the last digit shown."""
    found = []
    for title in dict.fromkeys(row.title for row in rows):
        same = [row for row in rows if row.title == title]
        if len({row.words for row in same}) == 1:
            found.append((title, same[0].words))
        else:
            where = {"linear": "On the linear plant", "mujoco": "In MuJoCo"}
            parts = (f"{where[row.plant]}, {row.words[:1].lower()}{row.words[1:]}" for row in same)
            found.append((title, " ".join(parts)))
    return found


def _names(rows: Sequence[Row]) -> list[str]:
    """The numbers that have a line; ends of confidence intervals stand with their number."""
    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    return [name for name in names if not re.search(r", (from|to)( \(|$)", name)]


def _table(kind: Shown, rows: Sequence[Row], norms: Norms | None) -> dict[str, Any]:
    """Numbers down, cases and plants across, at last those of others."""
    names = _names(rows)
    common, what = kind.common(names)
    lines = []
    for name in names:
        factor, label = _shown(kind, name)
        cells = [_cell(row, name, factor) for row in rows]
        lines.append((label.removeprefix(common), [*cells, *((_norm(norms, name, factor),) if norms else ())]))
    cases = list(dict.fromkeys(row.title for row in rows))
    several = len({row.plant for row in rows}) > 1
    heads = [(title, sum(row.title == title for row in rows)) for title in cases]
    labels = [f"{row.title}, {plant_name(row.plant)}" if several else row.title for row in rows]
    spread = any(row.deviations for row in rows)
    return {
        "heads": [*heads, *(((norms.title, 1),) if norms else ())],
        "plants": [*(plant_name(row.plant) for row in rows), *(("recorded",) if norms else ())] if several else None,
        "labels": [*labels, *((norms.title,) if norms else ())],
        "trials": [*(str(row.trials) for row in rows), *((str(norms.trials),) if norms else ())],
        "lines": lines,
        "note": f"{what} {_SPREAD if spread else ''}".strip(),
    }


_SPREAD = "± is the standard deviation over trials."
_SAME = "Recordings of people are analysed in the same way."


def _shown(kind: Shown, name: str) -> tuple[float, str]:
    """The factor on a number, and its name with the unit in which people read it."""
    words, bracket, unit = name.rstrip(")").partition(" (")
    if not bracket:
        share = name.startswith("explained") or "share" in name
        return (100.0, f"{name} (%)") if share else (1.0, name)
    factor, unit = readable(unit) if kind.readable else (1.0, unit)
    return factor, f"{words} ({unit})"


def _cell(row: Row, name: str, factor: float) -> str:
    """A number with its standard deviation or its confidence interval."""
    value = row.numbers.get(name, np.nan)
    if not np.isfinite(value):
        return MISSING
    words, bracket, unit = name.partition(" (")
    low, high = (row.numbers.get(f"{words}, {end}{bracket}{unit}", np.nan) for end in ("from", "to"))
    shown = _number(factor * value)
    ends = [_number(factor * end) for end in (low, high)]
    if np.isfinite(low) and np.isfinite(high) and ends != [shown, shown]:
        return f"{shown} ({ends[0]} to {ends[1]})"
    spread = row.deviations.get(name, np.nan)
    if np.isfinite(spread) and spread > max(ROUNDING * abs(value), ROUNDING):
        return f"{shown} ± {number(factor * spread, 2)}"
    return shown


def _number(value: float) -> str:
    return "0" if abs(value) < ROUNDING else number(value, 3)


def _norm(norms: Norms, name: str, factor: float) -> str:
    if name not in norms.values:
        return MISSING
    mean, spread = norms.values[name]
    return f"{number(factor * mean, 3)} ± {number(factor * spread, 2)}"


_RESULTS = """\
{% if c.picture %}
<figure class="law">
<div class="panel" style="max-width: 46rem">{{ c.picture|drawn }}</div>
<figcaption><b>Figure {{ next_figure() }}.</b> {{ c.caption }}</figcaption>
</figure>
{% endif %}
<div class="wide"><table class="stack across">
<caption><b>Table {{ next_table() }}.</b> Results of each case. {{ c.note }}</caption>
<thead>
<tr><th scope="col"{% if c.plants %} rowspan="2"{% endif %}></th>{% for title, span in c.heads %}<th scope="colgroup" colspan="{{ span }}">{{ title }}</th>{% endfor %}</tr>
{% if c.plants %}<tr>{% for plant in c.plants %}<th scope="col">{{ plant }}</th>{% endfor %}</tr>
{% endif %}
</thead>
<tbody>
<tr><th scope="row">trials</th>{% for value in c.trials %}<td data-label="{{ c['labels'][loop.index0] }}">{{ value }}</td>{% endfor %}</tr>
{% for name, cells in c.lines %}
<tr><th scope="row">{{ name }}</th>{% for value in cells %}<td data-label="{{ c['labels'][loop.index0] }}">{{ value }}</td>{% endfor %}</tr>
{% endfor %}
</tbody>
</table></div>
"""  # noqa: E501

_METHODS = """\
{% for said in c.words %}
<p>{{ said }}</p>
{% endfor %}
"""
