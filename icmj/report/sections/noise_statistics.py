"""The section of cases under noise: distributions instead of a cycle, and sway beside that of young people."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base import numbers
from icmj.case.quantity import in_unit, quantities
from icmj.experiments.quiet_standing import YOUNG_PEOPLE
from icmj.measurement.measures import numbers_of
from icmj.measurement.statistics import Estimate
from icmj.report import style
from icmj.report.axes.noise import draw_histogram, draw_spectrum
from icmj.report.case_runs import CaseRuns
from icmj.report.material import Material
from icmj.report.panel import draw_alone
from icmj.report.picture import Drawing
from icmj.report.section import Section
from icmj.report.style import NAME
from icmj.report.wording import label_outputs

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def compose(material: Material) -> Section | None:
    """Histogram, spectra and numbers of every case under noise, or ``None`` where there is none."""
    items = [
        {
            "title": case.first.run.title,
            "pictures": [material.show(drawing) for drawing in drawings],
            "outputs": [f"RMS {name}" for name in label_outputs(case.first.actual)],
            "rows": _rows(case),
            "cycle": _cycle_sentence(case),
            "sway": _sway(case),
        }
        for case in material.cases
        if (drawings := list_drawings(case))
    ]
    return Section("noise", "Under noise", TEMPLATE, {"items": items}) if items else None


def list_drawings(case: CaseRuns) -> list[Drawing]:
    """Intervals and spectra of runs under noise."""
    if all(result.statistics is None for result in case.runs.values()):
        return []
    title = case.first.run.title
    return [
        Drawing(f"{case.name}_intervals", f"{title}, histogram of intervals", lambda: _draw_intervals(case)),
        Drawing(f"{case.name}_spectra", f"{title}, spectra of the outputs", lambda: _draw_spectra(case)),
    ]


def _draw_intervals(case: CaseRuns) -> Figure:
    return draw_alone(lambda axes: draw_histogram(axes, case))


def _draw_spectra(case: CaseRuns) -> Figure:
    """Power spectrum of every output on each plant, one axes for each."""
    return style.each_output(case.first.actual.n_y, lambda axes, i: draw_spectrum(axes, case, i), "frequency (Hz)")


def _cycle_sentence(case: CaseRuns) -> str:
    prediction = case.prediction
    if not prediction.cycle:
        return "No cycle is predicted without noise."
    kind = "one of a family" if prediction.verdict == "family" else prediction.verdict
    return (
        f"Without noise, the predicted cycle has Δ_crit = {numbers.number(prediction.delta_crit)} s and a period of "
        f"{numbers.number(prediction.period)} s; its orbit is {kind}."
    )


def estimate(found: Estimate | None, unit: float = 1.0) -> str:
    """A number with its confidence, in another unit where it is multiplied by ``unit``."""
    if found is None:
        return numbers.MISSING
    error = "" if not np.isfinite(found.error) else f" ± {numbers.number(found.error * unit, 1)}"
    return f"{numbers.number(found.value * unit, 3)}{error}"


def _rows(case: CaseRuns) -> list[list[Any]]:
    rows = []
    for plant, result in case.runs.items():
        found = result.statistics
        if found is not None:
            binding = estimate(found.binding, 100) if found.least > 0 else numbers.MISSING
            row = [NAME[plant], found.events, estimate(found.interval), estimate(found.interval_deviation), binding]
            each = zip(found.rms, quantities(result.actual), strict=True)
            rows.append([*row, *(estimate(rms, shown.factor) for rms, shown in each)])
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


TEMPLATE = """\
{% from "macros.html.j2" import beside, stack %}
<p>Under noise the motion is not periodic; it is described by distributions, which leave out the first tenth of the run. Each number is given with the half-width of its 95 % confidence interval, estimated from ten blocks. Δ<sub>min</sub> is the refractory period. RMS is the root mean square. The share of intervals that are as short as Δ<sub>min</sub> shows how often the refractory period, rather than the event rule, determines the next event.</p>
{% for item in c['items'] %}
<figure class="law">
{{ beside(item.title, item.pictures) }}
<div class="wide"><table class="stack">
{{ stack(["Plant", "Events", "Mean interval (s)", "Standard deviation (s)", "At Δ_min (%)"|notation] + item.outputs, item.rows) }}
{% if item.sway %}
<div class="wide"><table class="stack across">
<caption><b>Table {{ next_table() }}.</b> Sway of the centre of pressure from back to front over {{ item.sway.seconds }} s, beside young people who stand quietly (mean ± standard deviation of 24 trials of 60 s of eight people, recordings of Santos and Duarte 2016, doi 10.7717/peerj.2648). H is the exponent of stabilogram diffusion.</caption>
{{ stack([""] + item.sway.heads, item.sway.rows) }}
{% endif %}
<figcaption><b>Figure {{ next_figure() }}.</b> {{ item.title }}: histogram of the open-loop intervals, and power spectra of the outputs (Welch, Hann windows of a quarter of the run; faint: 95 % confidence band of the plant drawn last). {{ item.cycle|notation }}</figcaption>
</figure>
{% endfor %}
"""  # noqa: E501
