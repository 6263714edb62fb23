"""A kind of experiment: what it does to a run file, what it takes from a run, how that is analysed and drawn.

The frame (:mod:`icmj.study.experiment`) does the rest. A new kind has:

1. a table, a field of :class:`icmj.study.experiment_file.ExperimentFile` whose name is that of the kind;
2. an analysis of :class:`icmj.experiments.quiet_standing.Recording` in ``icmj/experiments/``, which returns a
   :class:`icmj.experiments.quiet_standing.Finding`;
3. a figure in :mod:`icmj.report.findings`, and in :mod:`icmj.report.experiment` a caption and its methods in words;
4. a subclass of :class:`Kind`, here or in :mod:`icmj.study.stance`, listed in ``KIND_OF`` of
   :mod:`icmj.study.experiment`;
5. what ``icmj new experiment`` writes for it: values in :mod:`icmj.case.drafting`, and its name among those of
   ``--stimulus`` (:class:`icmj.cli.arguments.New`).

The experiment on quiet standing: noise moves the body, nothing else does.

The double-step experiment: pairs of steps of a set-point, and how late each is responded to.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array, instants
from icmj.case.case import Case, PlantKind
from icmj.controller.setpoint import double_steps, find_step_pairs
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import ground_force, reaction
from icmj.errors import DataError, IcmjError
from icmj.experiments.quiet_standing import Finding, Recording, Standing, keep_complete, quiet_standing, sway_numbers
from icmj.experiments.reconstruction import EARLIEST, Reconstruction, reconstruct_steps
from icmj.experiments.refractoriness import DIRECTIONS, Explanation, Reactions, Refractoriness, analyse_reactions
from icmj.runfile.schema import RunFile
from icmj.series.even_rows import even_series, row_step
from icmj.series.series import EVEN, SETTLED, Series
from icmj.simulation.simulation import Simulation
from icmj.study.experiment_file import DoubleStepTable, ExperimentFile, QuietStandingTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class CaseResult:
    """The result for one case on one plant.

    Attributes:
        case: name of the case.
        title: title of the case in tables and figures.
        plant: ``linear``, ``mujoco``, or ``recording``.
        finding: result of the analysis; ``None`` if there is none, and ``words`` give the reason.
        trials: number of trials.
        words: the result in one sentence.
    """

    case: str
    title: str
    plant: str
    finding: Finding | None
    trials: int
    words: str


@dataclass(frozen=True, eq=False)
class Experiment:
    """The results of an experiment.

    Attributes:
        file: the experiment file.
        found: the results for each case on each plant, in the order of the file, or for recordings.
        recordings: names of the files of recordings; empty for simulated trials.
        notes: what was left out of them, or resampled, or is odd about them.
    """

    file: ExperimentFile
    found: tuple[CaseResult, ...]
    recordings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> CaseResult:
        """The result for a case, or for ``case.plant``."""
        for told in self.found:
            if name in (told.case, f"{told.case}.{told.plant}"):
                return told
        known = ", ".join(f"{told.case}.{told.plant}" for told in self.found)
        raise DataError(f"no case {name!r} in the experiment; expected one of {known}")


HALF = 0.5  # share explained below which a fit is told as none


def say_first(doubts: Sequence[str], words: str) -> str:
    """Words on a result, after what speaks against it."""
    return f"Not to be relied on: {'; '.join(doubts)}. {words}" if doubts else words


class Kind(ABC):
    """A kind of experiment, made from its table in an experiment file."""

    def __init__(self, settings: Any) -> None:
        self.settings = settings

    @abstractmethod
    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        """The run file of one trial: with the stimulus and the duration of this experiment.

        Only ``simulation`` and ``setpoint`` may depend on the seed. The seeds of noise are changed elsewhere from trial
        to trial.
        """

    @property
    def begin(self) -> float:
        """The time of a run at which its trial begins [s], and with it the times of rows and of events."""
        return 0.0

    @abstractmethod
    def recorded(self, case: Case, simulation: Simulation) -> Series:
        """The evenly sampled signals of a run that the analysis needs; a recording of people contains the same."""

    @abstractmethod
    def read(self, series: Series) -> Series:
        """The same signals from a file, of the part that the table asks for; DataError if a column is missing.

        A key of the table that has no effect on recordings is one of the stimulus, or is refused.
        """

    def stated(self, key: str) -> Any:
        """The value of a key that the file states; ``None`` of one that it leaves out.

        Defaults are of simulations: where the file does not say what is left out, a recording is taken whole.
        """
        return getattr(self.settings, key) if key in self.settings.model_fields_set else None

    @abstractmethod
    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> Finding:
        """The result of the trials of one case on one plant, or of recordings if neither is given.

        Raises:
            DataError: if the analysis is not possible, for example with too few trials.
        """

    @abstractmethod
    def draw_figure(self, found: Sequence[CaseResult]) -> Figure:
        """The figure of all results."""


def set_duration(run: RunFile, duration: float, rate: float) -> RunFile:
    """The run file with another duration [s], recorded at a rate [Hz]."""
    return run.with_(**{"simulation.duration": duration, "simulation.record_interval": 1 / rate})


def sample_rows(signals: Series, simulation: Simulation, rate: float, since: float = 0.0) -> Series:
    """Signals at the rows of a run, evenly sampled from ``since`` [s] on, which becomes 0.

    Nothing is interpolated across a break; the side that is given there is that of
    :meth:`icmj.Simulation.to_series`. A run that ended before ``since`` has one row.
    """
    t = instants(1 / rate, float(simulation.t[-1]), round(since * rate))
    if len(t) < 2:
        return replace(signals, t=signals.t[:1], values=signals.values[:1])
    return replace(signals, t=t - t[0], values=simulation.interpolate(signals.names, signals.values, t))


def cut_recording(series: Series, begin: float | None, duration: float | None, keys: str) -> Series:
    """The part of a recording that is analysed.

    Args:
        series: the recording; one that is a trial of an experiment has lost its beginning already.
        begin: what is left out after its first row [s].
        duration: of the part after this [s]; by default all.
        keys: of the table that say so, for the message.

    Raises:
        DataError: if the recording is shorter.
    """
    begin = None if SETTLED in series.facts else begin
    if len(series) > 1 and (begin is not None or duration is not None):
        first, step = float(series.t[0]), row_step(series.t)
        whole, asked = float(series.t[-1]) - first + step, (begin or 0.0) + (duration or 0.0)
        if whole < asked - EVEN * step:
            raise DataError(
                f"{whole:.6g} s of record; {keys} ask for {asked:g} s, lower them or leave them out to take all of it"
            )
        series = series.since(first + (begin or 0.0))
        series = series if duration is None else series.until(first + asked)
        if len(series) > 1:
            part = f"analysed from {series.t[0]:.6g} to {series.t[-1]:.6g} s"
            series = replace(series, facts={**series.facts, "part": part})
    return series


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
        pressure = sample_rows(ground_force(case.actual, simulation).chosen(["cop.x"]), simulation, rate, since)
        found = {name: float(value) for name, value in sway_numbers(pressure).items()}
    except IcmjError:
        return {}
    return {name: value for name, value in found.items() if np.isfinite(value)}


class QuietStandingKind(Kind):
    """See the module."""

    settings: QuietStandingTable

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        return set_duration(run, self.settings.settle + self.settings.duration, self.settings.rate)

    @property
    def begin(self) -> float:
        return self.settings.settle

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
        return sample_rows(whole.chosen(columns), simulation, self.settings.rate, self.begin)

    def read(self, series: Series) -> Series:
        series = series.chosen(self.settings.columns) if self.settings.columns else series
        settle, duration, rate = map(self.stated, ("settle", "duration", "rate"))
        return even_series(cut_recording(series, settle, duration, "settle and duration"), rate)

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> Standing:
        return quiet_standing(recordings, low_pass=self.settings.low_pass)

    def draw_figure(self, found: Sequence[CaseResult]) -> Figure:
        from icmj.report.findings import standing_figure

        return standing_figure(found)


TARGET, CONTROL, COMBINED = "target", "control", "followed"


@dataclass(frozen=True, eq=False)
class FoundDoubleStep:
    """Refractory duration and kind of controller, of all trials together; a :class:`Finding`.

    People were found to be refractory at reversals only (van de Kamp et al. 2013), so both directions are analysed by
    themselves, and all pairs together only if nothing is found in which the directions differ.

    Attributes:
        directions: results of each direction that has enough pairs, by name.
        pooled: result of all pairs; ``None`` if the directions differ.
        seen: the first trial as it was reconstructed.
        doubts: why reaction times may be none, said first.
    """

    directions: Mapping[str, Reactions]
    pooled: Reactions | None
    seen: Reconstruction
    doubts: tuple[str, ...] = ()

    @property
    def refractory(self) -> Refractoriness | None:
        """The estimates of all pairs; ``None`` if the directions differ."""
        return self.pooled.refractory if self.pooled else None

    @property
    def told(self) -> Explanation | None:
        """The kind of controller that explains all pairs; ``None`` if the directions differ."""
        return self.pooled.explanation if self.pooled else None

    @property
    def numbers(self) -> Mapping[str, float]:
        return {name: value for prefix, one in self._parts for name, value in _prefix(prefix, one.numbers).items()}

    @property
    def deviations(self) -> Mapping[str, float]:
        return {}

    @property
    def curves(self) -> Mapping[str, Array]:
        """Those of all pairs and of each direction; NaN behind the last interval of one that has fewer."""
        curves = {name: of for prefix, one in self._parts for name, of in _prefix(prefix, one.curves).items()}
        most = max(map(len, curves.values()))
        return {name: np.append(of, np.full(most - len(of), np.nan)) for name, of in curves.items()}

    @property
    def words(self) -> str:
        return say_first(self.doubts, self._result)

    @property
    def _result(self) -> str:
        if self.pooled is None:
            each = " ".join(f"{name[:1].upper()}{name[1:]}: {one.words}." for name, one in self.directions.items())
            return f"The two directions differ. {each}"
        sure = len(self.directions) == len(DIRECTIONS)
        same = self.seen.pairs.same
        alike = ", and the same in both directions" if sure else ", too few to compare both directions"
        if not sure and (same.all() or not same.any()):
            alike = f", all of them {'in the same direction' if same.all() else 'reversals'}"
        return f"{self.pooled.words[:1].upper()}{self.pooled.words[1:]}{alike}."

    @property
    def _parts(self) -> list[tuple[str, Reactions]]:
        return [
            *([("", self.pooled)] if self.pooled else []),
            *((f"{name}, ", of) for name, of in self.directions.items()),
        ]


AT_END = 0.05  # share of reaction times at an end of their range that is told; the bound is ours


def _doubts(seen: Sequence[Reconstruction], latest: float) -> tuple[str, ...]:
    """Why reaction times may be none: many at an end of the range sought, or a model that explains too little."""
    said, explained = [], np.concatenate([one.explained for one in seen])
    late = np.concatenate([((one.rt < EARLIEST + one.step) | (one.rt > latest - one.step)).ravel() for one in seen])
    if (share := float(late.mean())) > AT_END:
        said.append(
            f"{100 * share:.0f} % of the reaction times are at an end of the range sought, {EARLIEST:g} to {latest:g} s"
        )
    if (little := int((explained < HALF).sum())) > len(explained) / 2:
        said.append(
            f"the linear model explains less than half of the control around {little} of {len(explained)} pairs, "
            "which are left out"
        )
    return tuple(said)


def _prefix(prefix: str, named: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{prefix}{name}": of for name, of in named.items()}


class DoubleStepKind(Kind):
    """See the module."""

    settings: DoubleStepTable

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        table, keys = self.settings, {"output", "combination", "unit", *signature(double_steps).parameters}
        steps = {"kind": "double-steps"} | ({"name": COMBINED} if table.combination else {})
        steps |= table.model_dump(include=keys, exclude_defaults=True) | {"seed": seed}
        kept = [one.model_dump(exclude_defaults=True, exclude_none=True) for one in run.setpoint]
        moved = run.with_(setpoint=[*kept, steps])
        end = moved.setpoint[-1].whole
        assert end is not None
        return set_duration(moved, end, table.rate)

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        name = self.settings.control or f"u.{simulation.labels.inputs[0]}"
        one = sample_rows(simulation.to_series().chosen([name]), simulation, self.settings.rate)
        r = simulation.setpoint
        assert r is not None
        at = r.names.index(self.settings.output or COMBINED)
        return replace(
            one,
            values=np.column_stack([r(one.t)[:, at], one.values]),
            names=(TARGET, CONTROL),
            units=(r.units[at], one.units[0]),
            facts={"control": name},
        )

    def read(self, series: Series) -> Series:
        pair = series.chosen([self.settings.target, self.settings.control or CONTROL])
        for name, unit in zip(pair.names, pair.units, strict=True):
            if not unit:
                raise DataError(f"{name}: has no unit; give one, as in '{name} [rad]'")
        rate, step = self.stated("rate"), row_step(pair.t) if len(pair) > 1 else np.nan
        if rate is not None and abs(rate * step - 1) > EVEN:
            raise DataError(
                f"{1 / step:.6g} rows a second, and rate = {rate:g} in the file; a control that jumps cannot be "
                "resampled, leave rate out"
            )
        return replace(pair, names=(TARGET, CONTROL))

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundDoubleStep:
        table, seen = self.settings, []
        for one in keep_complete(recordings):
            pairs = find_step_pairs(one.series, TARGET)
            seen.append(reconstruct_steps(one.series, CONTROL, pairs, latest=table.latest))
        isi, rt = np.concatenate([one.pairs.isi for one in seen]), np.concatenate([one.rt for one in seen])
        same, step = np.concatenate([one.pairs.same for one in seen]), max(one.step for one in seen)
        directions = {}
        for name, of in zip(DIRECTIONS, (same, ~same), strict=True):
            with suppress(DataError):  # too few pairs
                directions[name] = analyse_reactions(isi[of], rt[of], step, table.shortest)
        agree = len(directions) < len(DIRECTIONS) or directions[DIRECTIONS[0]].agrees(directions[DIRECTIONS[1]])
        pooled = analyse_reactions(isi, rt, step, table.shortest) if agree else None
        return FoundDoubleStep(directions, pooled, seen[0], _doubts(seen, table.latest))

    def draw_figure(self, found: Sequence[CaseResult]) -> Figure:
        from icmj.report.findings import double_step_figure

        of = [one.finding for one in found if isinstance(one.finding, FoundDoubleStep)]
        return double_step_figure(found, of[0].seen if of else None)
