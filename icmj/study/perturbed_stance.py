"""Perturbed stance: the response to a pseudo-random tilt of the support surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.case.case import Case, PlantKind
from icmj.experiments.multisine import Multisine
from icmj.experiments.recording import Recording, completed
from icmj.experiments.stance_channels import StanceChannels, fit_channels
from icmj.runfile.schema import RunFile
from icmj.runfile.stimulus_tables import PerturbedStanceTable
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.simulation.surface import ternary_lines
from icmj.study.kind import Kind, Told, sampled, timed
from icmj.study.multisine import FoundMultisine, analyse_trials

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
        found["explained by the fitted channels"] = self.measured.explained(self.theory)
        for name, unit, value, half in self._fitted():
            mark = f" ({unit})" if unit else ""
            found |= {f"{name}{mark}": value, f"{name}, from{mark}": value - half, f"{name}, to{mark}": value + half}
        return found

    def _fitted(self) -> list[tuple[str, str, float, float]]:
        """Name, unit, value and half the width of the 95 % confidence interval of each fitted number."""
        c = self.channels
        assert c is not None
        names = (("P", "N m/rad"), ("D", "N m s/rad"), ("delay", "s"), ("weight of the surface", ""))
        widths = np.full(4, np.nan) if c.half_widths is None else c.half_widths
        values = (c.P, c.D, c.delay, c.weight)
        return [(*name, value, float(half)) for name, value, half in zip(names, values, widths, strict=True)]

    @property
    def words(self) -> str:
        if self.channels is None:
            return super().words
        fitted = []
        for name, unit, value, half in self._fitted():
            low, middle, high = (f"{each:.3g}" for each in (value - half, value, value + half))
            interval = "" if low == high else f" ({low} to {high})"
            fitted.append(f"{name} {middle}{interval} {unit}".rstrip())
        return f"{super().words} Fitted channels, with 95 % intervals: {', '.join(fitted)}."


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
        how = {"period": table.period, "lines": self._lines()[:, 1] / (2 * np.pi)}
        found, each = analyse_trials(trials, TILT, BODY, how)
        channels = self._channels(found)
        theory = None if channels is None else channels.response(found.line)
        return FoundStance(found, theory, (trials[0].units[0], trials[0].units[1]), each, channels)

    def drawn(self, found: Sequence[Told]) -> Figure:
        from icmj.report.findings import multisine_figure

        units = (one.finding.units for one in found if isinstance(one.finding, FoundMultisine))
        return multisine_figure(found, next(units, ("", "")))

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
