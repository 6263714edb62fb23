"""The paper's statements, answered, and what differs from the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from icmj.report.pairing import CaseRuns
from icmj.report.sections.section import Section
from icmj.report.sections.wording import verdicts
from icmj.report.statements import STATEMENTS, answered, differences, untested


def statements(cases: Sequence[CaseRuns]) -> Section:
    """Every statement of the paper's section "Features to note", answered."""
    groups: dict[str, dict[str, Any]] = {}
    for item in answered(cases):
        paper = item.case.first.run.case.paper
        group = groups.setdefault(
            item.case.name,
            {"title": item.case.first.run.case.title, "note": paper.note, "figure": paper.figure, "items": []},
        )
        group["items"].append(item)
    extra = [{"title": case.first.run.case.title, "note": _note(case)} for case in cases if case.name not in groups]
    return Section(
        "statements",
        "The paper’s statements",
        "statements.html.j2",
        {
            "groups": list(groups.values()),
            "extra": extra,
            "untested": untested(cases),
            "total": len(STATEMENTS),
            "differences": differences(cases),
        },
    )


def _note(case: CaseRuns) -> str:
    """The run file's note on a case that the paper does not have, and what its runs say beyond the prediction."""
    return " ".join([case.first.run.case.paper.note or "Not in the paper.", *verdicts(case)])
