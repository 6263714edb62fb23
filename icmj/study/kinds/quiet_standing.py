"""Quiet standing: noise moves the body, and nothing else does; its sway, and the intervals between events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, PrivateAttr, SerializerFunctionWrapHandler, model_serializer

from icmj.base.array import NonNegative, Positive
from icmj.case.case import Case, PlantKind
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import ground_force
from icmj.experiments.quiet_standing import YOUNG_PEOPLE, Standing, quiet_standing
from icmj.experiments.recording import Recording
from icmj.measurement.measure import Measure
from icmj.measurement.measures import find_measure, numbers_of
from icmj.report import style
from icmj.report.experiment import Norms, Row
from icmj.report.findings import LINE, ShownResult, assign_colours, under_legend
from icmj.runfile.schema import RunFile
from icmj.series.even_rows import resample_series
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.study.kind import CaseResult, Kind, Names, Rate, Word, cut_recording, sample_rows, set_duration
from icmj.work.own_code import Code

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PRESSURE = "cop.x"
SIGNALS = {PRESSURE: "the centre of pressure from back to front (cop.x)"}
YOUNG = (
    "The values of young people are mean and standard deviation over 24 trials of 60 s of eight people on firm ground "
    "with open eyes, front to back, without a filter (recordings of Santos and Duarte 2016, doi 10.7717/peerj.2648)."
)


class QuietStandingTable(Kind):
    """Quiet standing: duration of the trials, and measured signals."""

    meaning: ClassVar[str] = "Quiet standing: measures of sway, and distributions of position and intervals."
    first_run: ClassVar[str] = "quiet-standing"

    duration: Positive = 60.0
    """Duration of the part of a trial that is analysed [s]."""
    settle: NonNegative = 10.0
    """Duration before this part, which is left out [s]."""
    rate: Rate = 100.0
    """Sampling rate [Hz]."""
    low_pass: Positive | None = 10.0
    """Cut-off frequency of the filter that is applied before all measures [Hz]."""
    columns: Annotated[list[Word], Field(max_length=2)] = []
    """Signals that are measured (default: the centre of pressure, forwards; without a model, the outputs)."""
    measures: Annotated[list[Word], Field(max_length=100)] = []
    """Measures of sway beside the standard ones: the ``module:name`` of your own, or the name of one that is not
    standard."""

    _further: tuple[Measure, ...] = PrivateAttr(default=())

    @model_serializer(mode="wrap")
    def _leave_out_no_measures(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What made the trials of older folders had no such key."""
        return {key: value for key, value in write(self).items() if key != "measures" or value}

    @property
    def references(self) -> tuple[str, ...]:
        return tuple(name for name in self.measures if ":" in name)

    def find_code(self, code: Code) -> None:
        self._further = tuple(find_measure(name, code) for name in self.measures)

    @classmethod
    def first_values(cls, names: Names, shipped: bool) -> dict[str, Any]:
        return {"duration": 60.0}

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        return set_duration(run, self.settle + self.duration, self.rate)

    @property
    def begin(self) -> float:
        return self.settle

    def record(self, case: Case, simulation: Simulation) -> Series:
        columns, model = tuple(self.columns), case.actual
        whole = simulation.to_series()
        if isinstance(model, MujocoPlant) and (not columns or any(name.startswith("cop.") for name in columns)):
            pressure = ground_force(model, simulation).chosen(["cop.x", "cop.y"])
            own = [name for name in whole.names if not name.startswith("cop.")]
            whole = whole.chosen(own)
            values = np.concatenate([whole.values, pressure.values], axis=1)
            whole = Series(whole.t, values, (*whole.names, *pressure.names), (*whole.units, *pressure.units))
            columns = columns or ("cop.x",)
        columns = columns or tuple(name for name in whole.names if name.startswith("y."))[:2]
        return sample_rows(whole.chosen(columns), simulation, self.rate, self.begin)

    def read(self, series: Series) -> Series:
        series = series.chosen(self.columns) if self.columns else series
        settle, duration, rate = map(self.stated, ("settle", "duration", "rate"))
        return resample_series(cut_recording(series, settle, duration, "settle and duration"), rate)

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> Standing:
        return quiet_standing(recordings, low_pass=self.low_pass, measures=self._further)

    def draw(self, found: Sequence[CaseResult]) -> Figure:
        return draw_distributions(found)

    def caption(self, rows: Sequence[Row]) -> str:
        names = [name for row in rows for name in row.numbers]
        signal = next(iter(measured_signals(names)), "the first signal")
        what = SIGNALS.get(signal, signal)
        place = f"distribution of {what}, divided by its standard deviation; dotted: normal distribution"
        if not any(name.startswith("interval, ") for name in names):
            return f"{place[0].upper()}{place[1:]}."
        return (
            f"Left: {place}. Right: distribution of the intervals between events; intervals that do not vary, as those "
            "of a clock, are not drawn."
        )

    def common(self, names: Sequence[str]) -> tuple[str, str]:
        signals = measured_signals(names)
        if len(signals) != 1:
            return "", ""
        return f"{signals[0]}, ", f"Measures are of {SIGNALS.get(signals[0], signals[0])}."

    def norms(self, names: Sequence[str]) -> Norms | None:
        if PRESSURE not in measured_signals(names):
            return None
        keys = {f"{PRESSURE}, {each.words}": each.key for each in numbers_of() if each.key in YOUNG_PEOPLE}
        named = {name: keys.get(name.partition(" (")[0]) for name in names}
        return Norms("young people", 24, {name: YOUNG_PEOPLE[key] for name, key in named.items() if key}, YOUNG)

    def methods(self, recorded: bool) -> str:
        made = f"{self.settle:g} s at the start of each trial are left out, and {self.duration:g} s are analysed. "
        filtered = (
            f"Signals pass a low-pass filter of {self.low_pass:g} Hz before they are measured. "
            if self.low_pass
            else ""
        )
        return (
            ("" if recorded else made)
            + filtered
            + "RMS is the root mean square about the mean; speed is the length of the path divided by the duration; H "
            "and D are exponent and coefficient of stabilogram diffusion at short (0.05 to 0.5 s) and long times (2.5 "
            "to 10 s). A distribution has several modes if the test for one mode gives p ≤ 0.01."
        )


def measured_signals(names: Sequence[str]) -> list[str]:
    """The signals of which there are measures, by the names of these."""
    bare = [name.partition(" (")[0] for name in names if not name.startswith("interval, ")]
    ends = [f", {number.words}" for number in numbers_of()]
    return list(dict.fromkeys(name.removesuffix(end) for name in bare for end in ends if name.endswith(end)))


def draw_distributions(found: Sequence[ShownResult]) -> Figure:
    """Left: density of the first signal in units of its deviation, dotted: normal; right: density of the intervals."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(150 * style.MM, 70 * style.MM))
    place, times = (figure.add_axes((left, 0.14, 0.4, 0.82)) for left in (0.09, 0.58))
    edges = np.linspace(-4, 4, 61)
    middle = (edges[1:] + edges[:-1]) / 2
    for one, colour in assign_colours(found):
        if not isinstance(one.finding, Standing):
            continue
        density, _ = np.histogram(one.finding.positions[:, 0], edges, density=True)
        place.plot(middle, density, color=colour, linestyle=LINE[one.plant], linewidth=1.2)
        intervals = one.finding.intervals
        if len(intervals) > 1 and np.ptp(intervals) > 1e-6 * intervals.mean():
            counts, bins = np.histogram(intervals, 40, density=True)
            times.stairs(counts, bins, color=colour, linestyle=LINE[one.plant], linewidth=1.2)
    place.plot(middle, np.exp(-(middle**2) / 2) / np.sqrt(2 * np.pi), **style.CRITICAL)
    place.set(xlabel="position (standard deviations)", ylabel="density (1/SD)")
    times.set(xlabel=r"interval $\Delta_{ol}$ (s)", ylabel="density (1/s)")
    if not times.patches:
        times.set_visible(False)
        place.set_position((0.09, 0.14, 0.89, 0.82))
    under_legend(figure, [place, times], found)
    return figure


KIND = QuietStandingTable
