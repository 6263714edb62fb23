"""Controllers without a prediction: how each moved, and several of one body side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from icmj.base import numbers
from icmj.base.array import between
from icmj.report.rivals import Rival, kind_in_words
from icmj.report.sections.section import Picture, Section
from icmj.report.sections.wording import notice_in_words
from icmj.report.style import NAME
from icmj.result.result import Result
from icmj.view.quantity import quantities

_RIVALS = (
    "Left: power spectra of the outputs over the second half of each run; right: rate of each output against its value "
    "over the last 20 s. Numbers are those of the table."
)


def others(
    runs: Sequence[Result],
    pictures: Mapping[str, Picture],
    first_number: int,
    motions: Mapping[str, str] = MappingProxyType({}),
) -> Section | None:
    """A table of the runs, and a figure of each case, or ``None`` where there are none.

    Args:
        runs: of any case, on any plant.
        pictures: outputs over time, by case.
        first_number: number of the first figure.
        motions: the script's names of runs, by case.
    """
    cases: dict[str, list[Result]] = {}
    for run in runs:
        cases.setdefault(run.run.case.name, []).append(run)
    items = [
        {
            "title": same[0].run.case.title,
            "number": number,
            "picture": pictures[name],
            "motion": motions.get(name),
            "facts": _facts(same[0]),
            "outputs": _outputs(same[0]),
            "rows": [_row(run) for run in same],
            "notices": list(map(notice_in_words, dict.fromkeys(notice for run in same for notice in run.notices))),
        }
        for number, (name, same) in enumerate(cases.items(), first_number)
    ]
    return Section("others", "Other controllers", "others.html.j2", {"items": items}) if items else None


def _facts(run: Result) -> list[tuple[str, str]]:
    return [(key.replace("_", " "), numbers.setting(_shown(value))) for key, value in run.controller.facts().items()]


def _outputs(run: Result) -> list[str]:
    return [
        shown.label(name).replace("deg", "°")
        for name, shown in zip(run.actual.outputs, quantities(run.actual), strict=True)
    ]


def rms_in_words(run: Result) -> str:
    """RMS of every output over the second half of the run, with its unit."""
    units = (shown.unit.replace("deg", "°") for shown in quantities(run.actual))
    each = zip(run.actual.outputs, _row(run)["rms"], units, strict=True)
    return ", ".join(
        f"{name} {value}{'' if unit.startswith('°') else ' '}{unit}".rstrip() for name, value, unit in each
    )


def _row(run: Result) -> dict[str, Any]:
    """RMS of every output over the second half of the run, weighted by time, and the outcome."""
    simulation, scale = run.simulation, np.array([shown.factor for shown in quantities(run.actual)])
    late = between(simulation.t, simulation.t[-1] / 2)
    t, y = simulation.t[late], simulation.y[late]
    length = float(t[-1] - t[0])
    with np.errstate(over="ignore", invalid="ignore"):
        rms = np.sqrt(np.trapezoid(y**2, t, axis=0) / length) if length > 0 else np.full(y.shape[1], np.nan)
    return {
        "plant": NAME[simulation.plant],
        "kind": kind_in_words(run),
        "end": simulation.outcome.message,
        "switches": len(simulation.events),
        "rms": [numbers.number(float(value), 3) for value in rms * scale],
    }


def _shown(value: Any) -> Any:
    return (value.item() if value.size == 1 else value.tolist()) if isinstance(value, np.ndarray) else value


def rivals(found: Sequence[tuple[Sequence[Rival], tuple[Picture, Picture]]], first_number: int) -> Section | None:
    """A table and two pictures for each body, or ``None`` where none has several controllers.

    Args:
        found: the controllers of each body, with spectra and paths.
        first_number: number of the first figure.
    """
    items = [
        {
            "title": _of_group(group),
            "number": number,
            "pictures": pictures,
            "outputs": [f"{c.name} ({c.unit})".replace("deg", "°") for c in group[0].sway.coordinates],
            "rows": [_rival_row(n, rival) for n, rival in enumerate(group, 1)],
            "caption": _RIVALS,
        }
        for number, (group, pictures) in enumerate(found, first_number)
    ]
    return Section("controllers", "Controllers side by side", "rivals.html.j2", {"items": items}) if items else None


def _of_group(group: Sequence[Rival]) -> str:
    """Which controllers of one body these are, and on which plant."""
    kinds = [kind_in_words(rival.run) for rival in group]
    plant = "linear plant" if group[0].run.simulation.plant == "linear" else NAME[group[0].run.simulation.plant]
    return f"One body under {', '.join(kinds[:-1])} and {kinds[-1]} control, {plant}"


def _rival_row(number: int, rival: Rival) -> dict[str, Any]:
    simulation = rival.run.simulation
    late = simulation.events.t[between(simulation.events.t, simulation.t[-1] / 2)]
    return {
        "name": f"{number}. {rival.name}",
        "rate": numbers.number(len(late) / rival.sway.duration, 3),
        "outcome": simulation.outcome.kind,
        "measures": [
            (numbers.number(c.rms, 3), numbers.number(c.speed, 3), numbers.number(c.frequencies.median, 3))
            for c in rival.sway.coordinates
        ],
    }
