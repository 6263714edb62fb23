"""The experiment on quiet standing: noise moves the body, nothing else does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import between
from icmj.case.case import Case, PlantKind
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import ground_force, reaction
from icmj.errors import IcmjError
from icmj.experiments.quiet_standing import Standing, quiet_standing, sway_numbers
from icmj.experiments.recording import Recording
from icmj.runfile.schema import RunFile
from icmj.runfile.stimulus_tables import QuietStandingTable
from icmj.series.even import even_series
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.study.kind import Kind, Told, sampled, timed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PERSON = {"mass": (30.0, 200.0), "height": (0.5, 1.5)}  # kg, and m of the centre of mass: a body of a person's size


def measure_pressure(case: Case, simulation: Simulation, since: float, rate: float = 100.0) -> dict[str, float]:
    """Measures of the centre of pressure, back to front, of a body of a person's size.

    Args:
        case: the case.
        simulation: its run, on either plant.
        since: what is left out at the start [s].
        rate: sampling rate [Hz].

    Returns:
        numbers such as ``cop.x.rms`` [m, s]; none for a body of another size, for one on which other forces than the
        ground's act, or for a run that is too short.
    """
    if not isinstance(case.actual, MujocoPlant):
        return {}
    try:
        body = reaction(case.actual)
        if any(not low <= getattr(body, name) <= high for name, (low, high) in PERSON.items()):
            return {}
        pressure = sampled(ground_force(case.actual, simulation).chosen(["cop.x"]), simulation, rate, since)
        found = {name: float(value) for name, value in sway_numbers(pressure).items()}
    except IcmjError:
        return {}
    return {name: value for name, value in found.items() if np.isfinite(value)}


class QuietStandingKind(Kind):
    """See the module."""

    settings: QuietStandingTable

    def stimulated(self, run: RunFile, seed: int) -> RunFile:
        return timed(run, self.settings.settle + self.settings.duration, self.settings.rate)

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        columns, model = tuple(self.settings.columns), case.actual
        whole = simulation.to_series()
        if isinstance(model, MujocoPlant) and (not columns or any(name.startswith("cop.") for name in columns)):
            pressure = ground_force(model, simulation).chosen(["cop.x", "cop.y"])
            own = [name for name in whole.names if not name.startswith("cop.")]
            whole = whole.chosen(own)
            values = np.concatenate([whole.values, pressure.values], axis=1)
            whole = Series(whole.t, values, (*whole.names, *pressure.names), (*whole.units, *pressure.units))
            columns = columns or ("cop.x",)
        columns = columns or tuple(name for name in whole.names if name.startswith("y."))[:2]
        return sampled(whole.chosen(columns), simulation, self.settings.rate, self.settings.settle)

    def read(self, series: Series) -> Series:
        return even_series(series.chosen(self.settings.columns) if self.settings.columns else series)

    def analysed(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> Standing:
        settle = self.settings.settle if case is not None else 0.0
        later = [Recording(one.series, one.events[between(one.events, settle)], one.outcome) for one in recordings]
        return quiet_standing(later, low_pass=self.settings.low_pass)

    def drawn(self, found: Sequence[Told]) -> Figure:
        from icmj.report.findings import standing_figure

        return standing_figure(found)
