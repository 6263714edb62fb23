"""The section of coexisting attractors: every motion to which random starts of a case led."""

from __future__ import annotations

import numpy as np

from icmj.base import numbers
from icmj.case.quantity import Quantity, quantities
from icmj.case.result import Attractor
from icmj.report.judgement import judge_attractor
from icmj.report.material import Material
from icmj.report.section import Section


def compose(material: Material) -> Section | None:
    """Every motion found for each case, or ``None`` where no log holds a search."""
    rows = [
        {
            "title": case.first.run.title if i == 0 else "",
            "motion": _describe_motion(found),
            "intervals": _intervals(found),
            "peak": _peak(found, quantities(case.first.actual)),
            "starts": f"{found.count} of {round(found.count / found.share)}",
            "mark": judge_attractor(case.prediction, found.measurement),
        }
        for case in material.cases
        if case.linear is not None
        for i, found in enumerate(case.linear.attractors)
    ]
    return Section("attractors", "Coexisting attractors", TEMPLATE, {"rows": rows}) if rows else None


def _describe_motion(found: Attractor) -> str:
    """The motion in a few words."""
    measurement = found.measurement
    if measurement.kind == "cycle":
        return f"{'mirrored ' if measurement.mirrored else ''}cycle of {numbers.count(measurement.p or 0, 'event')}"
    words = {"homoclinic": "intervals grow without bound", "growth": "grows without bound: a fall"}
    return words.get(measurement.kind, measurement.kind)


def _peak(found: Attractor, units: tuple[Quantity, ...]) -> str:
    """Peak of all outputs if they share a unit, else of the first; of a motion that grows there is none."""
    if found.measurement.kind == "growth":
        return numbers.MISSING
    amplitude = np.asarray(found.measurement.amplitude)
    peak = float(np.max(amplitude if len(set(units)) == 1 else amplitude[:1])) * units[0].factor
    unit = units[0].unit.replace("deg", "°")
    return f"{numbers.number(peak, 3)}{unit if unit == '°' else f' {unit}'.rstrip()}"


def _intervals(found: Attractor) -> str:
    measurement = found.measurement
    if measurement.kind != "cycle":
        return numbers.MISSING
    distinct = measurement.intervals[: len(measurement.intervals) // (2 if measurement.mirrored else 1)]
    return ", ".join(numbers.number(float(interval), 5) for interval in distinct)


TEMPLATE = """\
{% from "macros.html.j2" import stack %}
<p>The prediction is local: even if the predicted cycle attracts, some initial states may lead to another motion. Each case was started on the linear plant from random states of several magnitudes around that of its run. The table lists every motion that was found; a motion and its mirror image count as one. The search is not exhaustive: it can miss a motion that few initial states lead to.</p>
<div class="wide"><table class="stack">
<caption><b>Table {{ next_table() }}.</b> Motions found on the linear plant, and the number of starts that led to each. ✓ agrees with the prediction; ○ a cycle or another motion that is not predicted.</caption>
{{ stack(["Case", "Motion", "Intervals (s)", "Peak output", "Starts", "As predicted"], c.rows) }}
"""  # noqa: E501
