"""Perturbed stance: the response to a pseudo-random tilt of the support surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.case.case import Case, PlantKind
from icmj.experiments.multisine import Multisine, multisine
from icmj.experiments.recording import Recording, completed
from icmj.experiments.stance_channels import StanceChannels, fit_channels
from icmj.runfile.schema import RunFile
from icmj.runfile.stimulus_tables import PerturbedStanceTable
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.simulation.surface import ternary_lines
from icmj.study.kind import Kind, Told, sampled, timed
from icmj.study.multisine import FoundMultisine

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TILT, BODY = "stimulus", "body"


@dataclass(frozen=True, eq=False)
class FoundStance(FoundMultisine):
    """Response of the body in space, remnant, and the fitted channels with their response; a :class:`Finding`.

    Attributes:
        channels: those whose response is nearest; ``None`` where no body was given to fit.
    """

    channels: StanceChannels | None = None

    @property
    def numbers(self) -> Mapping[str, float]:
        found = {name: value for name, value in super().numbers.items() if name != "explained by continuous control"}
        if self.channels is None:
            return found
        fitted = self.channels
        return found | {
            "explained by the fitted channels": self.measured.explained(self.theory),
            "P (N m/rad)": fitted.P,
            "D (N m s/rad)": fitted.D,
            "delay (s)": fitted.delay,
            "weight of the surface": fitted.weight,
        }

    @property
    def words(self) -> str:
        if self.channels is None:
            return super().words
        c = self.channels
        fit = f"stiffness P = {c.P:.4g} N m/rad, damping D = {c.D:.4g} N m s/rad, delay {c.delay:.3f} s, weight of the "
        return f"{super().words} Fitted channels: {fit}surface {c.weight:.3f}."


class PerturbedStanceKind(Kind):
    """See the module."""

    settings: PerturbedStanceTable

    def stimulated(self, run: RunFile, seed: int) -> RunFile:
        table, kept = self.settings, [one.model_dump(exclude_unset=True) for one in run.simulation.disturbance]
        tilt: dict[str, Any] = {
            "kind": "ternary", "surface": "tilt", "size": table.size, "interval": table.interval,
            "bandwidth": table.highest, "point": [0.0, 0.0, table.axis_height],
            "vertical": table.vertical, "vertical_rate": table.vertical_rate,
        }  # fmt: skip
        duration = (table.settle + table.periods) * table.period
        return timed(run.with_(**{"simulation.disturbance": [*kept, tilt]}), duration, table.rate)

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        since = self.settings.settle * self.settings.period
        name = self.settings.output or case.actual.linearisation.plant.outputs[0]
        one = sampled(simulation.to_series().chosen([f"y.{name}"]), simulation, self.settings.rate, since)
        tilt = self._tilt(one.t + (since if len(one) > 1 else 0.0))
        values = np.column_stack([tilt, one.values[:, 0] + tilt])
        return replace(one, values=values, names=(TILT, BODY), units=("rad", "rad"), facts={"response": f"y.{name}"})

    def read(self, series: Series) -> Series:
        pair = series.chosen([self.settings.stimulus, self.settings.response])
        return replace(pair, names=(TILT, BODY))

    def analysed(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundStance:
        trials = [one.series for one in completed(recordings)]
        table = self.settings
        if case is not None:  # the last sample begins the next period
            trials = [replace(one, t=one.t[:-1], values=one.values[:-1]) for one in trials]
        found = multisine(trials, TILT, BODY, period=table.period, lines=self._lines()[:, 1] / (2 * np.pi))
        channels = self._channels(found)
        return FoundStance(found, None if channels is None else channels.response(found.line), channels)

    def drawn(self, found: Sequence[Told]) -> Figure:
        from icmj.report.findings import multisine_figure

        return multisine_figure(found)

    def _lines(self) -> Array:
        return ternary_lines(self.settings.size, self.settings.interval, self.settings.highest)

    def _tilt(self, t: Array) -> Array:
        a, omega, phi = self._lines().T
        return np.asarray(np.cos(np.outer(t, omega) + phi) @ a)

    def _channels(self, found: Multisine) -> StanceChannels | None:
        table = self.settings
        if table.inertia is None or table.toppling is None:
            return None
        body = StanceChannels(table.inertia, table.toppling, table.stiffness, table.damping)
        return fit_channels(body, found.line, found.response, found.radius)
