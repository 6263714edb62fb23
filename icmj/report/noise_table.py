"""The cases that noise drives: distributions instead of a cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from icmj.base import numbers
from icmj.case.quantity import in_unit, quantities
from icmj.experiments.quiet_standing import YOUNG_PEOPLE
from icmj.measurement.measures import numbers_of
from icmj.measurement.statistics import Estimate
from icmj.report.case_runs import CaseRuns
from icmj.report.section import Picture, Section
from icmj.report.style import NAME
from icmj.report.summary import _cycle_sentence


def noise(
    cases: Sequence[CaseRuns], pictures: Mapping[str, tuple[Picture, Picture]], first_number: int
) -> Section | None:
    """Histogram, spectra and numbers of every case under noise, or ``None`` where there is none.

    Args:
        cases: all cases.
        pictures: histogram and spectra by case.
        first_number: number of the first figure.
    """
    shown = [case for case in cases if case.name in pictures]
    items = [
        {
            "title": case.first.run.title,
            "number": number,
            "pictures": pictures[case.name],
            "outputs": [
                shown.label(name).replace("deg", "°")
                for name, shown in zip(case.first.actual.outputs, quantities(case.first.actual), strict=True)
            ],
            "rows": _rows(case),
            "cycle": _cycle_sentence(case),
            "sway": _sway(case),
        }
        for number, case in enumerate(shown, first_number)
    ]
    return Section("noise", "Under noise", "noise.html.j2", {"items": items}) if items else None


def estimate(found: Estimate | None, unit: float = 1.0) -> str:
    """A number with its confidence, in another unit where it is multiplied by ``unit``."""
    if found is None:
        return numbers.MISSING
    error = "" if not np.isfinite(found.error) else f" ± {numbers.number(found.error * unit, 1)}"
    return f"{numbers.number(found.value * unit, 3)}{error}"


def _rows(case: CaseRuns) -> list[dict[str, Any]]:
    rows = []
    for plant, result in case.runs.items():
        found = result.statistics
        if found is not None:
            rows.append(
                {
                    "plant": NAME[plant],
                    "events": found.events,
                    "interval": estimate(found.interval),
                    "deviation": estimate(found.interval_deviation),
                    "binding": estimate(found.binding, 100) if found.least > 0 else numbers.MISSING,
                    "rms": [
                        estimate(rms, shown.factor)
                        for rms, shown in zip(found.rms, quantities(result.actual), strict=True)
                    ],
                }
            )
    return rows


def _sway(case: CaseRuns) -> dict[str, Any] | None:
    """Measures of the centre of pressure on each plant beside those of young people; ``None`` if there are none."""
    swayed = {plant: result for plant, result in case.runs.items() if result.sway}
    if not swayed:
        return None
    rows = []
    called = {number.key: number for number in numbers_of()}
    for key, (mean, spread) in YOUNG_PEOPLE.items():
        if key not in called:
            continue
        factor, unit = numbers.readable(called[key].unit_of("m"))
        values = (result.sway.get(f"cop.x.{key}") for result in swayed.values())
        own = [numbers.number(None if value is None else factor * value, 3) for value in values]
        young = f"{numbers.number(factor * mean, 3)} ± {numbers.number(factor * spread, 2)}"
        rows.append((in_unit(called[key].words, unit), *own, young))
    found = next(result.statistics for result in swayed.values() if result.statistics is not None)
    heads = ["linear plant" if plant == "linear" else NAME[plant] for plant in swayed]
    return {"heads": [*heads, "young people"], "rows": rows, "seconds": f"{found.end - found.start:.3g}"}
