"""Coexisting attractors, as found from random starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from icmj.base import numbers
from icmj.comparison.facts import on_predicted_cycle
from icmj.report.pairing import CaseRuns
from icmj.report.sections.section import Section
from icmj.result.result import Attractor
from icmj.view.quantity import Quantity, quantities


def attractors(cases: Sequence[CaseRuns]) -> Section | None:
    """Every motion found for each case, or ``None`` where no log holds a search."""
    rows = [
        {
            "title": case.first.run.case.title if i == 0 else "",
            "motion": motion(found),
            "intervals": _intervals(found),
            "peak": _peak(found, quantities(case.first.actual)),
            "starts": f"{found.count} of {round(found.count / found.share)}",
            "mark": numbers.mark(on_predicted_cycle(case.prediction, found.measurement)),
        }
        for case in cases
        if case.linear is not None
        for i, found in enumerate(case.linear.attractors)
    ]
    return Section("attractors", "Coexisting attractors", "attractors.html.j2", {"rows": rows}) if rows else None


def _peak(found: Attractor, units: tuple[Quantity, ...]) -> str:
    """Peak of all outputs if they share a unit, else of the first."""
    amplitude = np.asarray(found.measurement.amplitude)
    peak = float(np.max(amplitude if len(set(units)) == 1 else amplitude[:1])) * units[0].factor
    unit = units[0].unit.replace("deg", "°")
    return f"{numbers.number(peak, 3)}{unit if unit == '°' else f' {unit}'.rstrip()}"


def motion(found: Attractor) -> str:
    """The motion in a few words."""
    measurement = found.measurement
    match measurement.kind:
        case "cycle":
            events = "1 event" if measurement.p == 1 else f"{measurement.p} events"
            return f"{'mirrored ' if measurement.mirrored else ''}cycle of {events}"
        case "homoclinic":
            return "intervals grow without bound"
        case kind:
            return kind


def _intervals(found: Attractor) -> str:
    measurement = found.measurement
    if measurement.kind != "cycle":
        return numbers.MISSING
    distinct = measurement.intervals[: len(measurement.intervals) // (2 if measurement.mirrored else 1)]
    return ", ".join(numbers.number(float(interval), 5) for interval in distinct)
