"""What a kind of experiment is: a table of an experiment file that says what is done, recorded, computed and shown.

The frame (:mod:`icmj.study.experiment`) does the rest: trials side by side, kept, taken up again; recordings of people;
results, figure and page.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, SupportsIndex

from pydantic import Field

from icmj.base.array import Positive, list_multiples
from icmj.case.case import Case, PlantKind
from icmj.errors import DataError, RunFileError
from icmj.experiments.recording import Finding, Recording
from icmj.report.experiment import Norms, Row
from icmj.runfile.schema import RunFile
from icmj.runfile.table import Line, TomlTable
from icmj.series.even_rows import measure_row_step
from icmj.series.series import EVEN, SETTLED, Series
from icmj.simulation.simulation import Simulation
from icmj.work.own_code import Code, folder_of, guard, reference_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Rate = Annotated[Positive, Field(ge=1.0, le=1e5)]
Word = Annotated[Line, Field(min_length=1)]


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


@dataclass(frozen=True)
class Names:
    """Names of the inputs, outputs and states of a plant, which keys may need."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]


HALF = 0.5  # share explained below which a fit is told as none


def say_first(doubts: Sequence[str], words: str) -> str:
    """Words on a result, after what speaks against it."""
    return f"Not to be relied on: {'; '.join(doubts)}. {words}" if doubts else words


class Kind(TomlTable, ABC):
    """A kind of experiment: its table in an experiment file, whose keys are its settings."""

    meaning: ClassVar[str]
    """What it is, in one sentence, for the reference."""
    first_run: ClassVar[str] = "simple-0.8"
    """The shipped case that a first file is of where none is given."""
    first_changes: ClassVar[Mapping[str, Any]] = {}
    """What each case of a first file of this shipped case changes."""
    examples: ClassVar[Mapping[str, Any]] = {}
    """What a key may hold that is not set by default, for a first file."""
    readable: ClassVar[bool] = True
    """Whether the page gives numbers in the units in which people read them, such as mm and degrees."""

    @classmethod
    def first_values(cls, names: Names, shipped: bool) -> dict[str, Any]:
        """The keys that have a value in a first file, for a plant; ``shipped`` if it is that of ``first_run``."""
        return {}

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
    def record(self, case: Case, simulation: Simulation) -> Series:
        """The evenly sampled signals of a run that the analysis needs; a recording of people contains the same."""

    @abstractmethod
    def read(self, series: Series) -> Series:
        """The same signals from a file, of the part that the table asks for; DataError if a column is missing.

        A key of the table that has no effect on recordings is one of the stimulus, or is refused.
        """

    @property
    def references(self) -> tuple[str, ...]:
        """Code of the user's own that its keys name, as ``module:name``."""
        return ()

    def find_code(self, code: Code) -> None:
        """Find what its keys name, once, when the file is read.

        Raises:
            IcmjError: if it is not there, or may not be run.
        """

    def stated(self, key: str) -> Any:
        """The value of a key that the file states; ``None`` of one that it leaves out.

        Defaults are of simulations: where the file does not say what is left out, a recording is taken whole.
        """
        return getattr(self, key) if key in self.model_fields_set else None

    @abstractmethod
    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> Finding:
        """The result of the trials of one case on one plant, or of recordings if neither is given.

        Raises:
            DataError: if the analysis is not possible, for example with too few trials.
        """

    @abstractmethod
    def draw(self, found: Sequence[CaseResult]) -> Figure:
        """The figure of all results."""

    @abstractmethod
    def caption(self, rows: Sequence[Row]) -> str:
        """What the lines and markers of the figure are; cases and plants are in its legend."""

    @abstractmethod
    def methods(self, recorded: bool) -> str:
        """What was done, in words; without what was simulated if the trials are recordings of people."""

    def common(self, names: Sequence[str]) -> tuple[str, str]:
        """The beginning that names of numbers share, which their table leaves out, and a sentence that says it."""
        return "", ""

    def norms(self, names: Sequence[str]) -> Norms | None:
        """Numbers of others with these names, which stand beside; ``None`` if none are known."""
        return None

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        folder = folder_of(type(self))
        if folder is None:
            return super().__reduce_ex__(protocol)
        # in another process, a module from a folder has another name
        return _make_again, (folder, reference_of(self), self.model_dump(exclude_unset=True))


def _make_again(folder: Path, reference: str, keys: Mapping[str, Any]) -> Kind:
    return find_kind(Code(folder, allowed=True), reference).model_validate(keys)


def find_kind(code: Code, reference: str) -> type[Kind]:
    """A kind of experiment of the user's own.

    Raises:
        RunFileError: if its code may not be run or fails, or it is none.
    """
    found = code.find(reference)
    if not (isinstance(found, type) and issubclass(found, Kind)):
        raise RunFileError(f"{reference}: expected a class that inherits from icmj.study.Kind")
    if missing := [*sorted(found.__abstractmethods__), *(() if hasattr(found, "meaning") else ("meaning",))]:
        raise RunFileError(f"{reference}: a kind of experiment needs {', '.join(missing)}")
    return found


def at_work(kind: Kind) -> AbstractContextManager[None]:
    """Within the block a kind is at work: what one of the user's own raises is its failure, told in one line."""
    own = not type(kind).__module__.startswith("icmj.")
    return guard(reference_of(kind)) if own else nullcontext()


def set_duration(run: RunFile, duration: float, rate: float) -> RunFile:
    """The run file with another duration [s], recorded at a rate [Hz]."""
    return run.with_(**{"simulation.duration": duration, "simulation.record_interval": 1 / rate})


def sample_rows(signals: Series, simulation: Simulation, rate: float, since: float = 0.0) -> Series:
    """Signals at the rows of a run, evenly sampled from ``since`` [s] on, which becomes 0.

    Nothing is interpolated across a break; the side that is given there is that of
    :meth:`icmj.Simulation.to_series`. A run that ended before ``since`` has one row.
    """
    t = list_multiples(1 / rate, float(simulation.t[-1]), round(since * rate))
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
        first, step = float(series.t[0]), measure_row_step(series.t)
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
