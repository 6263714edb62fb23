"""Multi-sine: a periodic stimulus of chosen lines, as disturbance or as set-point; response and remnant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from icmj.base.array import MOST_ENTRIES, Array, Positive, Positives
from icmj.case.case import Case, PlantKind
from icmj.controller.setpoint import sines
from icmj.errors import AnalysisError, DataError
from icmj.experiments.linear_response import frequency_response
from icmj.experiments.recording import Recording
from icmj.report.experiment import Row
from icmj.runfile.schema import RunFile
from icmj.runfile.shapes import kind_of_course
from icmj.runfile.table import TomlTable
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.simulation.sources import Sinusoids
from icmj.study.kind import CaseResult, Kind, Names, Rate, Word, sample_rows, set_duration
from icmj.study.periodic_response import (
    PeriodicResponse,
    analyse_trials,
    draw_response,
    expect_whole_samples,
    say_periods,
    take_periods,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


STIMULUS, RESPONSE = "stimulus", "response"


class MultisineTable(Kind):
    """A sum of sinusoids with given lines and random phases, as a disturbance or as a set-point.

    Lines are integer multiples of 1 / period, so that the record is periodic.
    """

    meaning: ClassVar[str] = "Multi-sine: frequency response and remnant."
    first_run: ClassVar[str] = "three-link-0.9"
    examples: ClassVar[Mapping[str, Any]] = {
        "input": "torque", "setpoint": "angle", "response": "u.ankle_torque"
    }  # fmt: skip

    input: Word | None = None
    """Input to whose command the stimulus is added. Give either ``input`` or ``setpoint``."""
    setpoint: Word | None = None
    """Output, or state, of the assumed plant whose set-point moves."""
    amplitude: Positive
    """Amplitude of each line [unit of the input or output]."""
    period: Positive = 10.0
    """Period of the stimulus [s]."""
    lines: Annotated[Positives, Field(max_length=MOST_ENTRIES)]
    """Frequencies [Hz], each an integer multiple of 1 / period."""
    periods: Annotated[int, Field(ge=2, le=10_000)] = 10
    """Number of periods that are analysed."""
    settle: Annotated[int, Field(ge=0, le=10_000)] = 2
    """Number of periods before them, in which transients die out."""
    rate: Rate = 100.0
    """Sampling rate [Hz]. A period must contain a whole number of samples."""
    response: Word | None = None
    """Signal whose response is analysed, such as u.ankle_torque (default: the first command)."""
    stimulus: Word = "stimulus"
    """For a recording: column of the stimulus."""

    @model_validator(mode="after")
    def _is_periodic(self) -> MultisineTable:
        if (self.input is None) == (self.setpoint is None):
            raise ValueError("give one of input and setpoint")
        cycles = [line * self.period for line in self.lines]
        wrong = [line for line, turns in zip(self.lines, cycles, strict=True) if abs(turns - round(turns)) > 1e-6]
        wrong += [line for line, turns in zip(self.lines, cycles, strict=True) if round(turns) < 1]
        if wrong:
            raise ValueError(
                f"lines: {wrong[0]:g} Hz is no whole multiple of 1 / period, {1 / self.period:g} Hz; the record would "
                "not be periodic"
            )
        if len({round(turns) for turns in cycles}) < len(cycles):
            raise ValueError("lines: a frequency is repeated")
        expect_whole_samples(self.period, self.rate)
        if max(self.lines) >= self.rate / 2:
            raise ValueError(f"lines: {max(self.lines):g} Hz is not below half the rate, {self.rate / 2:g} Hz")
        return self

    @classmethod
    def first_values(cls, names: Names, shipped: bool) -> dict[str, Any]:
        return {
            "input": names.inputs[0], "amplitude": 2.0, "period": 10.0, "lines": [0.1, 0.3, 0.7, 1.3, 2.3],
            "periods": 4,
        }  # fmt: skip

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        a, lines, phases = self.amplitude, self.lines, _phases(len(self.lines), seed)
        if self.input is not None:
            key, kept = "simulation.disturbance", [_plain(one) for one in run.simulation.disturbance]
            terms = [[a, 2 * np.pi * f, phi] for f, phi in zip(lines, phases, strict=True)]
            acts = {"input": self.input, "on": "command", "terms": terms}
            entry: dict[str, Any] = {"kind": kind_of_course(Sinusoids), **acts}
        else:
            key, kept = "setpoint", [_plain(one) for one in run.setpoint]
            # a set-point is of sines, a disturbance of cosines
            turned = [phi + np.pi / 2 for phi in phases]
            moves = {"output": self.setpoint, "size": a, "frequencies": lines, "phases": turned}
            entry = {"kind": kind_of_course(sines), **moves}
        duration = (self.settle + self.periods) * self.period
        return set_duration(run.with_(**{key: [*kept, entry]}), duration, self.rate)

    @property
    def begin(self) -> float:
        return self.settle * self.period

    def record(self, case: Case, simulation: Simulation) -> Series:
        whole = simulation.to_series()
        name = self._response(simulation.labels.inputs)
        pair = whole.chosen([name])
        one = sample_rows(pair, simulation, self.rate, self.begin)
        t = one.t + (self.begin if len(one) > 1 else 0.0)
        stimulus, unit = self._stimulus(case, simulation, t)
        return replace(
            one,
            values=np.column_stack([stimulus, one.values]),
            names=(STIMULUS, RESPONSE),
            units=(unit, one.units[0] or "1"),
            facts={"response": name},
        )

    def read(self, series: Series) -> Series:
        if self.response is None:
            raise DataError("[multisine] response says which column of a recording is analysed; give it")
        pair = series.chosen([self.stimulus, self.response])
        return take_periods(self, self.period, replace(pair, names=(STIMULUS, RESPONSE)))

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> PeriodicResponse:
        names = (STIMULUS, RESPONSE)
        found = analyse_trials(recordings, names, self.period, self.lines, simulated=case is not None)
        return found if case is None else replace(found, theory=self._theory(case, found.measured.line))

    def draw(self, found: Sequence[CaseResult]) -> Figure:
        return draw_response(found)

    def _response(self, inputs: Sequence[str]) -> str:
        return self.response or f"u.{self.input or inputs[0]}"

    def _stimulus(self, case: Case, simulation: Simulation, t: Array) -> tuple[Array, str]:
        """Its values at times of the run, and its unit."""
        if self.input is None:
            r = simulation.setpoint
            assert r is not None
            at = r.names.index(str(self.setpoint))
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
            signal = found.of(f"d.{self.input}" if self.input else f"r.{self.setpoint}")
        except AnalysisError:
            return None
        kind, _, name = self._response(plant.inputs).partition(".")
        names = {"x": plant.states, "y": plant.outputs, "u": law.plant.inputs}.get(kind, ())
        return np.asarray(getattr(found, kind)[:, names.index(name), signal]) if name in names else None

    def caption(self, rows: Sequence[Row]) -> str:
        return (
            "Gain (response divided by stimulus) and phase at the lines of the stimulus, with 95 % confidence "
            "intervals of the gain, and power of the response. Thin lines: linear theory, for continuous control of "
            "the same design. Small points: power between the lines of the stimulus (the remnant)."
        )

    def methods(self, recorded: bool) -> str:
        where = (
            f"added to the command of {self.input}" if self.input else f"that moves the set-point of {self.setpoint}"
        )
        made = (
            f"The stimulus is a sum of {len(self.lines)} sinusoids of amplitude {self.amplitude:g} and a period of "
            f"{self.period:g} s, {where}; {say_periods(self.settle, self.periods)} "
        )
        return (
            ("" if recorded else made)
            + "The response at each line is the mean over periods, and its confidence follows from their scatter, with "
            "periods assumed to be independent. The remnant is the power at all other frequencies."
        )


def _phases(count: int, seed: int) -> list[float]:
    """So many phases from a seed [rad]."""
    return [float(phase) for phase in 2 * np.pi * np.random.default_rng(seed).random(count)]


def _plain(table: TomlTable) -> dict[str, Any]:
    return table.model_dump(exclude_defaults=True, exclude_none=True)


KIND = MultisineTable
