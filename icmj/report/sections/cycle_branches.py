"""The section of branches: cycles of the event-driven loop as a parameter varies."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from icmj.base import numbers
from icmj.cycle.branch import Branch
from icmj.report.branch import branch_figure, parameter_in_words
from icmj.report.material import Material
from icmj.report.picture import Drawing
from icmj.report.section import Section
from icmj.report.style import NAME

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_BRANCHES = (
    "(a) Open-loop intervals and (b) peak of the first output against the parameter; solid: attracting cycles, "
    "dashed: repelling ones{}. (c) Multipliers μ of the first branch, the factors on small "
    " deviations over one turn of the cycle; (d) some of its cycles."
)


def compose(material: Material) -> Section | None:
    """Branches of one run file along one parameter in one picture, or ``None`` where there is none."""
    groups: dict[tuple[str, str], list[Branch]] = {}
    for branch in material.branches:
        groups.setdefault((branch.run.case.name, branch.parameter), []).append(branch)
    items = []
    for (name, parameter), branches in groups.items():
        born = [branch for branch in branches if _is_born(branch, branches)]
        group = [*(branch for branch in branches if branch not in born), *born]
        facts = [_branch_fact(branch, n if len(group) > 1 else 0) for n, branch in enumerate(group, 1)]
        beneath = len({one.plant for one in group}) > 1
        caption = _BRANCHES.format(", broad and faint: the linear plant" if beneath else "")
        title = f"{group[0].run.title}: cycles along the {parameter_in_words(parameter)}"
        drawing = Drawing(
            f"{name}_along_{parameter.replace(':', '-')}",
            f"{group[0].run.title}, cycles along {parameter}",
            partial(_draw_group, group),
        )
        items.append({"title": title, "facts": facts, "pictures": [(material.draw(drawing), caption)]})
    return Section("branches", "Branches of cycles", TEMPLATE, {"items": items}) if items else None


def _draw_group(group: Sequence[Branch]) -> Figure:
    beneath = [branch for branch in group if branch.plant == "linear"]
    above = [branch for branch in group if branch.plant != "linear"]
    return branch_figure(above or beneath, beneath if above else ())


def _is_born(branch: Branch, group: Sequence[Branch]) -> bool:
    """Whether a branch begins at a special point of another one."""
    points = [special.value for other in group if other is not branch for special in other.specials]
    return any(np.isclose(branch.value[0], value, rtol=1e-3) for value in points)


def _branch_fact(branch: Branch, number: int) -> tuple[str, str]:
    ends = " to ".join(numbers.short(float(branch.value[i])) for i in (0, -1))
    attracting = int(branch.attracting.sum())
    said = f"{len(branch)} {branch.name}, {branch.parameter} from {ends}, {attracting} of them attracting. "
    words = [special.words for special in branch.specials]
    if not words or words[-1] != branch.end:
        words.append(f"The branch {branch.end}.")
    where = "linear plant" if branch.plant == "linear" else NAME[branch.plant]
    return f"branch {number}, {where}" if number else where, said + " ".join(words)


TEMPLATE = '{% include "items.html.j2" %}\n'
