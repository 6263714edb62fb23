"""The section on many runs of one case: sweeps with their maps, coexisting attractors, and branches of cycles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from icmj.base import numbers
from icmj.case.quantity import Quantity, quantities
from icmj.case.result import Attractor
from icmj.case.sweep_table import SweepTable
from icmj.cycle.branch import Branch
from icmj.report.branch import parameter_in_words
from icmj.report.case_runs import CaseRuns
from icmj.report.judgement import judge_attractor
from icmj.report.section import Picture, Section
from icmj.report.sections import motion
from icmj.report.style import NAME

_KINDS = {
    "too short": "too short to settle",
    "no events": "without events",
    "homoclinic": "with growing intervals",
    "growth": "growing",
    "decay": "dying out",
}


def sweeps(
    found: Sequence[SweepTable], pictures: Mapping[str, Sequence[tuple[Picture, str]]], first_number: int
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
        items.append({"title": swept.title, "facts": _sweep_facts(swept), "pictures": shown})
    return Section("sweeps", "Sweeps", "sweeps.html.j2", {"items": items}) if items else None


def _sweep_facts(swept: SweepTable) -> list[tuple[str, str]]:
    status = Counter(swept.texts("status"))
    done = f"{len(swept.table)} of {swept.points}" if len(swept.table) < swept.points else f"{swept.points}"
    bad = ", ".join(f"{count} {name}" for name, count in sorted(status.items()) if name != "ok")
    facts = [("Points", f"{done}{f'; {bad}' if bad else ''}")]
    for name, field in swept.varies:
        facts.append((name, f"{_range(swept, name)}{f' ({field})' if field and field != name else ''}"))
    for plant in NAME:
        if f"{plant}_kind" in swept.table.column_names:
            on = sum(value is True for value in swept.texts(f"{plant}_on_predicted"))
            kinds = Counter(kind for kind in swept.texts(f"{plant}_kind") if kind)
            words = (
                f"{count} on a cycle ({on} on the predicted one)"
                if kind == "cycle"
                else f"{count} {_KINDS.get(kind, kind)}"
                for kind, count in kinds.most_common()
            )
            facts.append((_plant(plant), ", ".join(words)))
        elif f"{plant}_outcome" in swept.table.column_names:
            ends = Counter(outcome for outcome in swept.texts(f"{plant}_outcome") if outcome)
            facts.append((_plant(plant), ", ".join(f"{count} {outcome}" for outcome, count in ends.most_common())))
    return facts


def _plant(plant: str) -> str:
    return "linear plant" if plant == "linear" else NAME[plant]


def _range(swept: SweepTable, name: str) -> str:
    values = sorted(set(swept.texts(name)))
    try:
        at = np.array(values, float)
        words = f"{numbers.short(float(at[0]))} to {numbers.short(float(at[-1]))}"
        return f"{words}, {len(at)} values" if len(at) > 1 else numbers.short(float(at[0]))
    except (TypeError, ValueError):
        return ", ".join(map(str, values[:6])) + (" …" if len(values) > 6 else "")


_BRANCHES = (
    "(a) Open-loop intervals and (b) peak of the first output against the parameter; solid: attracting cycles, "
    "dashed: repelling ones{}. (c) Multipliers μ of the first branch, the factors on small "
    " deviations over one turn of the cycle; (d) some of its cycles."
)


def attractors(cases: Sequence[CaseRuns]) -> Section | None:
    """Every motion found for each case, or ``None`` where no log holds a search."""
    rows = [
        {
            "title": case.first.run.title if i == 0 else "",
            "motion": motion(found),
            "intervals": _intervals(found),
            "peak": _peak(found, quantities(case.first.actual)),
            "starts": f"{found.count} of {round(found.count / found.share)}",
            "mark": judge_attractor(case.prediction, found.measurement),
        }
        for case in cases
        if case.linear is not None
        for i, found in enumerate(case.linear.attractors)
    ]
    return Section("attractors", "Coexisting attractors", "attractors.html.j2", {"rows": rows}) if rows else None


def branches(found: Sequence[tuple[Sequence[Branch], Picture]], first_number: int) -> Section | None:
    """Every group of branches with its picture, or ``None`` where there is none.

    Args:
        found: branches of one run file along one parameter, and their picture.
        first_number: number of the first figure.
    """
    items = []
    for i, (group, picture) in enumerate(found):
        facts = [_branch_fact(branch, n if len(group) > 1 else 0) for n, branch in enumerate(group, 1)]
        beneath = len({one.plant for one in group}) > 1
        caption = _BRANCHES.format(", broad and faint: the linear plant" if beneath else "")
        title = f"{group[0].run.title}: cycles along the {parameter_in_words(group[0].parameter)}"
        items.append({"title": title, "facts": facts, "pictures": [(first_number + i, picture, caption)]})
    return Section("branches", "Branches of cycles", "sweeps.html.j2", {"items": items}) if items else None


def _peak(found: Attractor, units: tuple[Quantity, ...]) -> str:
    """Peak of all outputs if they share a unit, else of the first; of a motion that grows there is none."""
    if found.measurement.kind == "growth":
        return numbers.MISSING
    amplitude = np.asarray(found.measurement.amplitude)
    peak = float(np.max(amplitude if len(set(units)) == 1 else amplitude[:1])) * units[0].factor
    unit = units[0].unit.replace("deg", "°")
    return f"{numbers.number(peak, 3)}{unit if unit == '°' else f' {unit}'.rstrip()}"


def _branch_fact(branch: Branch, number: int) -> tuple[str, str]:
    ends = " to ".join(numbers.short(float(branch.value[i])) for i in (0, -1))
    attracting = int(branch.attracting.sum())
    said = f"{len(branch)} {branch.name}, {branch.parameter} from {ends}, {attracting} of them attracting. "
    words = [special.words for special in branch.specials]
    if not words or words[-1] != branch.end:
        words.append(f"The branch {branch.end}.")
    where = "linear plant" if branch.plant == "linear" else NAME[branch.plant]
    return f"branch {number}, {where}" if number else where, said + " ".join(words)


def _intervals(found: Attractor) -> str:
    measurement = found.measurement
    if measurement.kind != "cycle":
        return numbers.MISSING
    distinct = measurement.intervals[: len(measurement.intervals) // (2 if measurement.mirrored else 1)]
    return ", ".join(numbers.number(float(interval), 5) for interval in distinct)
