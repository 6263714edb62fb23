"""A kind of experiment: what it does to a run file, what it takes from a run, how that is analysed and drawn.

The frame (:mod:`icmj.study.experiment`) does the rest. A new kind is four things:

1. its table, a field of :class:`icmj.runfile.experiment_tables.ExperimentFile` whose name is that of the kind;
2. an analysis of :class:`icmj.experiments.recording.Recording` in ``icmj/experiments/``, which returns a
   :class:`icmj.experiments.recording.Finding`;
3. a figure in ``icmj/report/``;
4. a subclass of :class:`Kind` in ``icmj/study/``, listed in ``KIND_OF`` of :mod:`icmj.study.experiment`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from icmj.base.array import instants
from icmj.case.case import Case, PlantKind
from icmj.errors import DataError
from icmj.experiments.recording import Finding, Recording
from icmj.runfile.experiment_tables import ExperimentFile
from icmj.runfile.schema import RunFile
from icmj.series.pieces import piecewise
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Told:
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
    """

    file: ExperimentFile
    found: tuple[Told, ...]
    recordings: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Told:
        """The result for a case, or for ``case.plant``."""
        for told in self.found:
            if name in (told.case, f"{told.case}.{told.plant}"):
                return told
        known = ", ".join(f"{told.case}.{told.plant}" for told in self.found)
        raise DataError(f"no case {name!r} in the experiment; expected one of {known}")


class Kind(ABC):
    """A kind of experiment, made from its table in an experiment file."""

    def __init__(self, settings: Any) -> None:
        self.settings = settings

    @abstractmethod
    def stimulated(self, run: RunFile, seed: int) -> RunFile:
        """The run file of one trial: with the stimulus and the duration of this experiment.

        Only ``simulation`` and ``setpoint`` may depend on the seed. The seeds of noise are changed elsewhere from trial
        to trial.
        """

    @abstractmethod
    def recorded(self, case: Case, simulation: Simulation) -> Series:
        """The evenly sampled signals of a run that the analysis needs; a recording of people contains the same."""

    @abstractmethod
    def read(self, series: Series) -> Series:
        """The same signals from a file; DataError if a column is missing."""

    @abstractmethod
    def analysed(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> Finding:
        """The result of the trials of one case on one plant, or of recordings if neither is given.

        Raises:
            DataError: if the analysis is not possible, for example with too few trials.
        """

    @abstractmethod
    def drawn(self, found: Sequence[Told]) -> Figure:
        """The figure of all results."""


def timed(run: RunFile, duration: float, rate: float) -> RunFile:
    """The run file with another duration [s], recorded at a rate [Hz]."""
    return run.with_(**{"simulation.duration": duration, "simulation.record_interval": 1 / rate})


def sampled(signals: Series, simulation: Simulation, rate: float, since: float = 0.0) -> Series:
    """Signals at the rows of a run, evenly sampled from ``since`` [s] on, which becomes 0.

    Nothing is interpolated across an event, an action or a step of the set-point; the side that is given there is that
    of :meth:`icmj.Simulation.to_series`. A run that ended before ``since`` has one row.
    """
    t = instants(1 / rate, float(simulation.t[-1]), round(since * rate))
    if len(t) < 2:
        return replace(signals, t=signals.t[:1], values=signals.values[:1])
    resets, others = simulation.breaks
    values = piecewise(simulation.t, signals.values, t, jumps=resets, breaks=others)
    return replace(signals, t=t - t[0], values=values)
