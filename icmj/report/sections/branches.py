"""Branches of cycles: their picture, range and special points."""

from __future__ import annotations

from collections.abc import Sequence

from icmj.base import numbers
from icmj.cycle.branch import Branch
from icmj.report.sections.section import Picture, Section
from icmj.report.style import NAME

_CAPTION = (
    "(a) Open-loop intervals and (b) peak of the first output against the parameter; solid: attracting cycles, dashed: "
    "repelling ones, pale: the linear plant. (c) Multipliers μ of the first branch, the factors on small deviations "
    "over one turn of the cycle; (d) some of its cycles."
)


def branches(found: Sequence[tuple[Sequence[Branch], Picture]], first_number: int) -> Section | None:
    """Every group of branches with its picture, or ``None`` where there is none.

    Args:
        found: branches of one run file along one parameter, and their picture.
        first_number: number of the first figure.
    """
    items = []
    for i, (group, picture) in enumerate(found):
        facts = [fact for branch in group for fact in _facts(branch)]
        title = f"{group[0].run.case.title}: cycles along {group[0].parameter}"
        items.append({"title": title, "facts": facts, "pictures": [(first_number + i, picture, _CAPTION)]})
    return Section("branches", "Branches of cycles", "sweeps.html.j2", {"items": items}) if items else None


def numbered(section: Section | None) -> int:
    """How many figures a section of items has."""
    return 0 if section is None else sum(len(item["pictures"]) for item in section.context["items"])


def _facts(branch: Branch) -> list[tuple[str, str]]:
    ends = " to ".join(numbers.short(float(branch.value[i])) for i in (0, -1))
    attracting = int(branch.attracting.sum())
    told = f"{len(branch)} {branch.name}, {branch.parameter} from {ends}, {attracting} of them attracting. "
    words = [special.words for special in branch.specials]
    if not words or words[-1] != branch.end:
        words.append(f"The branch {branch.end}.")
    return [(f"{NAME[branch.plant]} plant", told + " ".join(words))]
