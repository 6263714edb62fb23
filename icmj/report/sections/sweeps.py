"""Sweeps: what was computed, how it went, and its maps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from icmj.base import numbers
from icmj.report.sections.section import Picture, Section
from icmj.report.style import NAME
from icmj.result.swept import Swept


def sweeps(
    found: Sequence[Swept], pictures: Mapping[str, Sequence[tuple[Picture, str]]], first_number: int
) -> Section | None:
    """Every sweep with its pictures, or ``None`` where there is none.

    Args:
        found: the sweeps.
        pictures: pictures and their captions by the name of the sweep.
        first_number: number of the first figure.
    """
    items = []
    for swept in found:
        shown = [(first_number + i, *each) for i, each in enumerate(pictures[swept.name])]
        first_number += len(shown)
        items.append({"title": swept.title, "facts": _facts(swept), "pictures": shown})
    return Section("sweeps", "Sweeps", "sweeps.html.j2", {"items": items}) if items else None


def _facts(swept: Swept) -> list[tuple[str, str]]:
    status = Counter(swept.texts("status"))
    done = f"{len(swept.table)} of {swept.points}" if len(swept.table) < swept.points else f"{swept.points}"
    bad = ", ".join(f"{count} {name}" for name, count in sorted(status.items()) if name != "ok")
    facts = [("Points", f"{done}{f'; {bad}' if bad else ''}")]
    for name, field in swept.varies:
        facts.append((name, f"{_range(swept, name)}{f' ({field})' if field and field != name else ''}"))
    for plant, word in NAME.items():
        if f"{plant}_kind" in swept.table.column_names:
            on = sum(value is True for value in swept.texts(f"{plant}_on_predicted"))
            kinds = Counter(kind for kind in swept.texts(f"{plant}_kind") if kind)
            told = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
            facts.append((f"{word} plant", f"{told}; {on} on the predicted cycle"))
        elif f"{plant}_outcome" in swept.table.column_names:
            ends = Counter(outcome for outcome in swept.texts(f"{plant}_outcome") if outcome)
            facts.append((f"{word} plant", ", ".join(f"{count} {outcome}" for outcome, count in ends.most_common())))
    return facts


def _range(swept: Swept, name: str) -> str:
    values = sorted(set(swept.texts(name)))
    try:
        at = np.array(values, float)
        words = f"{numbers.short(float(at[0]))} to {numbers.short(float(at[-1]))}"
        return f"{words}, {len(at)} values" if len(at) > 1 else numbers.short(float(at[0]))
    except (TypeError, ValueError):
        return ", ".join(map(str, values[:6])) + (" …" if len(values) > 6 else "")
