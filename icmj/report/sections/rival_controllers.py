"""The section of rivals: controllers of one body on one plant, measured alike, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from icmj.base import numbers
from icmj.base.array import agree, count_steps, is_between
from icmj.case.motion import curve
from icmj.case.quantity import quantities
from icmj.case.result import Result
from icmj.errors import DataError
from icmj.measurement.sway import BEST_KNOWN, Sway, measure_sway
from icmj.report import style
from icmj.report.material import Material
from icmj.report.picture import Drawing
from icmj.report.section import Section
from icmj.report.style import NAME
from icmj.report.wording import kind_in_words
from icmj.series.series import Series

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

from icmj.report.sway_figures import COLOURS, LOWEST_POWER

RATE, FASTEST_RIVAL = 100.0, 10.0  # Hz: of the samples, and drawn
SHOWN = 20.0  # s of a path

_RIVALS = (
    "Left: power spectra of the outputs over the second half of each run; right: rate of each output against its value "
    "over the last 20 s. Numbers are those of the table."
)


def compose(material: Material) -> Section | None:
    """A table and two pictures for each body, or ``None`` where none has several controllers."""
    if not material.others:
        return None
    runs = [result for case in material.cases for result in case.runs.values()]
    items = [
        {
            "title": _of_group(group),
            "pictures": [material.draw(drawing) for drawing in _list_figures(group, number)],
            "measures": [
                measure
                for c in group[0].sway.coordinates
                for measure in (f"RMS {c.name} ({c.unit})".replace("deg", "°"), "Speed (1/s)", "Median (Hz)")
            ],
            "rows": [_rival_row(n, rival) for n, rival in enumerate(group, 1)],
            "caption": _RIVALS,
        }
        for number, group in enumerate(rivals([*runs, *material.others]), 1)
    ]
    return Section("controllers", "Controllers side by side", TEMPLATE, {"items": items}) if items else None


def _list_figures(group: Sequence[Rival], number: int) -> tuple[Drawing, Drawing]:
    return (
        Drawing(f"controllers_{number}_spectra", "Spectra of the outputs", lambda: _draw_spectra(group)),
        Drawing(f"controllers_{number}_paths", "Rates against outputs", lambda: _draw_paths(group)),
    )


def _of_group(group: Sequence[Rival]) -> str:
    """Which controllers of one body these are, and on which plant."""
    kinds = [kind_in_words(rival.run) for rival in group]
    plant = "linear plant" if group[0].run.simulation.plant == "linear" else NAME[group[0].run.simulation.plant]
    return f"One body under {', '.join(kinds[:-1])} and {kinds[-1]} control, {plant}"


def _rival_row(number: int, rival: Rival) -> list[str]:
    simulation = rival.run.simulation
    late = simulation.events.t[is_between(simulation.events.t, simulation.t[-1] / 2)]
    rate = numbers.number(len(late) / rival.sway.duration, 3)
    measures = (numbers.number(c.number(key), 3) for c in rival.sway.coordinates for key in BEST_KNOWN)
    return [f"{number}. {rival.name}", simulation.outcome.kind, rate, *measures]


@dataclass(frozen=True, eq=False)
class Rival:
    """One controller of a body: its run, what it is called, and the sway over the second half of the run."""

    name: str
    run: Result
    sway: Sway


def rivals(runs: Sequence[Result]) -> list[list[Rival]]:
    """Runs of one body on one plant under several controllers, one of which at least has no prediction."""
    groups: list[list[Result]] = []
    for run in runs:
        group = next((group for group in groups if _same_body(group[0], run)), None)
        if group is None:
            groups.append(group := [])
        group.append(run)
    found = [[rival for run in group if (rival := _rival(run)) is not None] for group in groups]
    return [group for group in found if len(group) > 1 and any(rival.run.prediction is None for rival in group)]


def _same_body(one: Result, other: Result) -> bool:
    a, b = one.actual, other.actual
    same = (one.simulation.plant, a.outputs) == (other.simulation.plant, b.outputs)
    return same and agree((a.A, a.B, a.C), (b.A, b.B, b.C))


def _rival(run: Result) -> Rival | None:
    """The controller's entry; ``None`` if the run is too short or not finite."""
    simulation, shown = run.simulation, quantities(run.actual)
    start, end = float(simulation.t[-1]) / 2, float(simulation.t[-1])
    t = start + np.arange(count_steps((end - start) * RATE)) / RATE
    if not np.isfinite(simulation.y).all() or not len(t):
        return None
    columns = zip(simulation.y.T, shown, strict=True)
    values = np.column_stack([unit.factor * np.interp(t, simulation.t, y) for y, unit in columns])
    series = Series(t, values, run.actual.outputs, tuple(unit.unit for unit in shown))
    try:
        return Rival(run.run.title, run, measure_sway(series))
    except DataError:
        return None


def _draw_spectra(group: Sequence[Rival]) -> Figure:
    """Power spectrum of every output under each controller."""
    coordinates = group[0].sway.coordinates

    def draw(axes: Axes, i: int) -> None:
        largest = 0.0
        for n, rival in enumerate(group):
            found = rival.sway.spectrum
            drawn = (found.frequency > 0) & is_between(found.frequency, 0.0, FASTEST_RIVAL)
            power = found.power[drawn, i]
            largest = max(largest, float(power.max(initial=0.0)))
            axes.loglog(
                found.frequency[drawn],
                power,
                color=COLOURS[n % len(COLOURS)],
                linewidth=1.2,
                label=_rival_label(group, n),
            )
        c = coordinates[i]
        axes.set_ylim(bottom=LOWEST_POWER * (largest or 1.0))
        axes.set_ylabel(f"{style.words(c.name)}{f' ({c.unit}²/Hz)' if c.unit else ''}")

    return style.each_output(len(coordinates), draw, "frequency (Hz)", 6)


def _draw_paths(group: Sequence[Rival]) -> Figure:
    """Rate against value of every output under each controller, over the last seconds."""
    plant = group[0].run.actual
    ends = [float(rival.run.simulation.t[-1]) for rival in group]
    paths = [curve(rival.run, end - SHOWN, end) for rival, end in zip(group, ends, strict=True)]

    def draw(axes: Axes, i: int) -> None:
        shown = quantities(plant)[i]
        for n, path in enumerate(paths):
            y, v = (shown.factor * signal[:, i] for signal in path)
            axes.plot(y, v, color=COLOURS[n % len(COLOURS)], linewidth=0.9, label=_rival_label(group, n))
        axes.set_ylabel(shown.label(style.words(plant.outputs[i]), "/s"))

    return style.each_output(plant.n_y, draw, quantities(plant)[-1].label("value"), 6)


def _rival_label(group: Sequence[Rival], n: int) -> str:
    """The number of a controller, with its kind where there is room."""
    return f"{n + 1}: {kind_in_words(group[n].run)}" if len(group) <= 3 else str(n + 1)


TEMPLATE = """\
{% from "macros.html.j2" import beside, stack %}
<p>Runs of the same actual plant under different controllers, measured in the same way over the second half of each run: root mean square about the mean (RMS), mean speed and median frequency of every output. Actions are the events of an intermittent controller and the switches of a switched one.</p>
{% for item in c['items'] %}
<figure class="law">
{{ beside(item.title, item.pictures) }}
<div class="wide"><table class="stack">
{{ stack(["Controller", "Run", "Actions (1/s)"] + item.measures, item.rows) }}
<figcaption><b>Figure {{ next_figure() }}.</b> {{ item.title }}. {{ item.caption }}</figcaption>
</figure>
{% endfor %}
"""  # noqa: E501
