"""The figures of several controllers of one body: spectra of the outputs, and their paths, on each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import count_steps, is_between
from icmj.case.motion import curve
from icmj.case.quantity import quantities
from icmj.case.result import Result, has_prediction
from icmj.errors import DataError
from icmj.measurement.sway import Sway, measure_sway
from icmj.report import style
from icmj.series.series import Series

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

from icmj.report.sway_figures import COLOURS, LOWEST_POWER

RATE, FASTEST_RIVAL = 100.0, 10.0  # Hz: of the samples, and drawn
SHOWN = 20.0  # s of a path


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
    return [group for group in found if len(group) > 1 and not all(has_prediction(rival.run) for rival in group)]


def _same_body(one: Result, other: Result) -> bool:
    a, b = one.actual, other.actual
    if one.simulation.plant != other.simulation.plant or (a.n, a.n_u, a.outputs) != (b.n, b.n_u, b.outputs):
        return False
    return all(np.allclose(x, y, rtol=1e-9, atol=1e-12) for x, y in ((a.A, b.A), (a.B, b.B), (a.C, b.C)))


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


def spectra_figure(group: Sequence[Rival]) -> Figure:
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


def paths_figure(group: Sequence[Rival]) -> Figure:
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


def kind_in_words(run: Result) -> str:
    """The kind of a controller; switched feedback that never switches is continuous."""
    facts = run.controller.facts()
    return "continuous" if facts.get("switches") is False else run.controller.kind
