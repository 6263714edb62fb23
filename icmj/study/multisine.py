"""The multi-sine experiment: a periodic stimulus of chosen lines, as disturbance or as set-point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.case.case import Case, PlantKind
from icmj.errors import AnalysisError, DataError
from icmj.experiments.frequency_response import frequency_response
from icmj.experiments.multisine import Multisine, multisine
from icmj.experiments.recording import Recording, completed
from icmj.runfile.schema import RunFile
from icmj.runfile.stimulus_tables import MultisineTable
from icmj.runfile.table import TomlTable
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.simulation.sources import Sinusoids
from icmj.study.kind import Kind, Told, sampled, timed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STIMULUS, RESPONSE = "stimulus", "response"
LEAST = 0.01  # %: a smaller share of the power is called so


@dataclass(frozen=True, eq=False)
class FoundMultisine:
    """Response and remnant, and the continuous controller's response; a :class:`Finding`.

    Attributes:
        measured: over all periods.
        theory: of the linear loop at the excited lines, or that of the continuous controller of the same design, shape
            (L,); ``None`` where there is none.
        units: of stimulus and response.
        each: of each trial alone; empty for one trial.
    """

    measured: Multisine
    theory: np.ndarray | None
    units: tuple[str, str]
    each: tuple[Multisine, ...] = ()

    @property
    def numbers(self) -> Mapping[str, float]:
        return self._numbers(self.measured)

    @property
    def deviations(self) -> Mapping[str, float]:
        each = [self._numbers(one) for one in self.each]
        return {name: float(np.std([one[name] for one in each], ddof=1)) for name in each[0]} if each else {}

    def _numbers(self, found: Multisine) -> dict[str, float]:
        theory = np.nan if self.theory is None else found.explained(self.theory)
        return {
            "remnant, share of power": found.remnant,
            "explained by the best linear model": found.explained(),
            "explained by continuous control": theory,
            "coherence, mean": float(np.nanmean(found.coherence)) if np.isfinite(found.coherence).any() else np.nan,
            f"RMS ({self.units[1]})": float(np.sqrt(found.power.sum())),
        }

    @property
    def curves(self) -> Mapping[str, Array]:
        found = self.measured
        place = {name: np.full(len(found.frequency), np.nan) for name in ("real", "imag", "radius", "coherence")}
        theory = np.full((len(found.frequency), 2), np.nan)
        for name, values in (
            ("real", found.response.real),
            ("imag", found.response.imag),
            ("radius", found.radius),
            ("coherence", found.coherence),
        ):
            place[name][found.excited] = values
        if self.theory is not None:
            theory[found.excited] = np.column_stack([self.theory.real, self.theory.imag])
        return {
            "frequency (Hz)": found.frequency,
            "power": found.power,
            "excited": found.excited.astype(float),
            **place,
            "theory, real": theory[:, 0],
            "theory, imag": theory[:, 1],
        }

    @property
    def words(self) -> str:
        found = self.measured
        spread = 100 * self.deviations.get("remnant, share of power", np.nan)
        share, sure = 100 * found.remnant, f" ± {spread:.2g}" if spread >= LEAST else ""
        remnant = f"less than {LEAST:g} %" if share < LEAST else f"{share:.3g}{sure} %"
        said = f"{remnant} of the power is at frequencies that the stimulus does not contain; the best linear model "
        said = f"{said}explains {100 * found.explained():.3g} %, over {found.periods} periods."
        return f"{said[0].upper()}{said[1:]}"


class MultisineKind(Kind):
    """See the module."""

    settings: MultisineTable

    def stimulated(self, run: RunFile, seed: int) -> RunFile:
        table = self.settings
        a, lines, phases = table.amplitude, table.lines, _phases(len(table.lines), seed)
        if table.input is not None:
            key, kept = "simulation.disturbance", [_plain(one) for one in run.simulation.disturbance]
            terms = [[a, 2 * np.pi * f, phi] for f, phi in zip(lines, phases, strict=True)]
            sines: dict[str, Any] = {"kind": "sinusoids", "input": table.input, "on": "command", "terms": terms}
        else:
            key, kept = "setpoint", [_plain(one) for one in run.setpoint]
            # a set-point is of sines, a disturbance of cosines
            turned = [phi + np.pi / 2 for phi in phases]
            sines = {"kind": "sines", "output": table.setpoint, "size": a, "frequencies": lines, "phases": turned}
        duration = (table.settle + table.periods) * table.period
        return timed(run.with_(**{key: [*kept, sines]}), duration, table.rate)

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        whole = simulation.to_series()
        name = self._response(simulation.labels.inputs)
        pair = whole.chosen([name])
        since = self.settings.settle * self.settings.period
        one = sampled(pair, simulation, self.settings.rate, since)
        t = one.t + (since if len(one) > 1 else 0.0)
        stimulus, unit = self._stimulus(case, simulation, t)
        return replace(
            one,
            values=np.column_stack([stimulus, one.values]),
            names=(STIMULUS, RESPONSE),
            units=(unit, one.units[0] or "1"),
            facts={"response": name},
        )

    def read(self, series: Series) -> Series:
        if self.settings.response is None:
            raise DataError("[multisine] response says which column of a recording is analysed; give it")
        pair = series.chosen([self.settings.stimulus, self.settings.response])
        return replace(pair, names=(STIMULUS, RESPONSE))

    def analysed(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundMultisine:
        trials = [one.series for one in completed(recordings)]
        table = self.settings
        if case is not None:  # the last sample begins the next period
            trials = [replace(one, t=one.t[:-1], values=one.values[:-1]) for one in trials]
        how: dict[str, Any] = {"period": table.period, "lines": table.lines}
        found, each = analyse_trials(trials, STIMULUS, RESPONSE, how)
        units = (trials[0].units[0], trials[0].units[1])
        return FoundMultisine(found, None if case is None else self._theory(case, found.line), units, each)

    def drawn(self, found: Sequence[Told]) -> Figure:
        from icmj.report.findings import multisine_figure

        units = (one.finding.units for one in found if isinstance(one.finding, FoundMultisine))
        return multisine_figure(found, next(units, ("", "")))

    def _response(self, inputs: Sequence[str]) -> str:
        return self.settings.response or f"u.{self.settings.input or inputs[0]}"

    def _stimulus(self, case: Case, simulation: Simulation, t: Array) -> tuple[Array, str]:
        """Its values at times of the run, and its unit."""
        if self.settings.input is None:
            r = simulation.setpoint
            assert r is not None
            at = r.names.index(str(self.settings.setpoint))
            return r(t)[:, at], r.units[at] or "1"
        source = case.settings.disturbance[-1]
        assert isinstance(source, Sinusoids)
        units = dict(zip(simulation.labels.inputs, simulation.labels.input_units, strict=False))
        values = sum((a * np.cos(omega * t + phi) for a, omega, phi in source.terms), 0 * t)
        return values, units.get(source.input or "") or "1"

    def _theory(self, case: Case, line: Array) -> np.ndarray | None:
        law = case.controller
        plant = case.actual.linearisation.plant
        try:
            found = frequency_response(plant, law, line, match="position")
            signal = found.of(f"d.{self.settings.input}" if self.settings.input else f"r.{self.settings.setpoint}")
        except AnalysisError:
            return None
        kind, _, name = self._response(plant.inputs).partition(".")
        names = {"x": plant.states, "y": plant.outputs, "u": law.plant.inputs}.get(kind, ())
        return np.asarray(getattr(found, kind)[:, names.index(name), signal]) if name in names else None


def analyse_trials(
    trials: Sequence[Series], stimulus: str, response: str, how: Mapping[str, Any]
) -> tuple[Multisine, tuple[Multisine, ...]]:
    """The result of all trials together, and that of each; none of each where there is one trial."""
    each = [multisine(one, stimulus, response, **how) for one in trials] if len(trials) > 1 else []
    return multisine(trials, stimulus, response, **how), tuple(each)


def _phases(count: int, seed: int) -> list[float]:
    """So many phases from a seed [rad]."""
    return [float(phase) for phase in 2 * np.pi * np.random.default_rng(seed).random(count)]


def _plain(table: TomlTable) -> dict[str, Any]:
    return table.model_dump(exclude_defaults=True, exclude_none=True)
