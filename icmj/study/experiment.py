"""The experiment: trials of each case on each plant, side by side in several processes, kept, analysed and drawn.

    OUT/experiment.json   what it is of (:mod:`icmj.work.folder`)
    OUT/trials/           the signals of each trial, and its events, as Parquet: what stands there is done
    OUT/results.parquet   the curves that were found, by case and plant
    OUT/summary.json      the numbers
    OUT/figure.png, .svg, report.html

What an experiment is, its kind says (:mod:`icmj.study.kind`). The trials of a folder are recordings like anybody's:
``icmj experiment FILE --recording OUT/trials/…`` analyses them again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from icmj.base.environment import single_threaded
from icmj.case.case import Case, PlantKind, expect_prediction, prepare, simulate
from icmj.controller.controller import continuous_limit
from icmj.controller.trigger import ClockTrigger, Trigger
from icmj.errors import DataError, IcmjError, RunFileError
from icmj.experiments.many import LAST
from icmj.experiments.recording import Recording
from icmj.runfile.experiment_tables import CaseTable, ExperimentFile, load_experiment
from icmj.runfile.schema import RunFile
from icmj.series.reading import read_series
from icmj.simulation.settings import reseeded
from icmj.study.double_step import DoubleStepKind
from icmj.study.estimate import refuse_trials
from icmj.study.intersection_point import IntersectionPointKind
from icmj.study.kind import Experiment, Kind, Told
from icmj.study.multisine import MultisineKind
from icmj.study.perturbed_stance import PerturbedStanceKind
from icmj.study.quiet_standing import QuietStandingKind
from icmj.study.trials import has_trial, read_trial, resume_experiment, write_results, write_trial
from icmj.work.folder import Folder
from icmj.work.workers import Task, Workers, processes

KIND_OF: dict[str, type[Kind]] = {
    "double_step": DoubleStepKind,
    "intersection_point": IntersectionPointKind,
    "multisine": MultisineKind,
    "perturbed_stance": PerturbedStanceKind,
    "quiet_standing": QuietStandingKind,
}


def kind_of(file: ExperimentFile) -> Kind:
    """The kind of an experiment file, with its settings."""
    return KIND_OF[file.kind](file.settings)


Tell = Callable[[str, float], None]


def run_experiment(
    file: ExperimentFile | Path | str,
    out: Path | str | None = None,
    *,
    jobs: int | None = None,
    progress: Tell | None = None,
    longest: float | None = None,
) -> Experiment:
    """Carry out an experiment, or its unfinished part, and analyse it.

    Args:
        file: the experiment file, its path, or the name of a shipped one.
        out: folder for trials, results and figure; an experiment that was begun there is resumed. Nothing is stored if
            ``None``.
        jobs: number of processes; by default the number of cores.
        progress: called repeatedly with a description of the current work and the completed fraction, 0–1.
        longest: estimated time that the trials which are not stored yet may take [s]; ``None`` for any.

    Raises:
        RunFileError: if the experiment file or a run file does not validate.
        StudyError: if the folder contains another experiment, the trials take too long or too much memory, or a process
            died.
        IcmjError: errors of the plants, designs, runs or the analysis.
    """
    made = file if isinstance(file, ExperimentFile) else load_experiment(file)
    kind, conditions = kind_of(made), list(conditions_of(made))
    cases = {one.case: _prepared(kind, one, made.experiment.seed) for one in conditions}
    if longest is not None:
        work, count = [], made.experiment.repetitions
        for one in conditions:
            stored = sum(out is not None and has_trial(Path(out), one.label, i) for i in range(count))
            work.append((_controlled(one, cases[one.case]), one.plant, count - stored))
        refuse_trials(made.path, work, processes(jobs), longest)
    with resume_experiment(out, made) as folder:
        trials = _trials(made, kind, conditions, folder, jobs, progress)
        if progress is not None:
            progress("analysing", 0.97)
        told = tuple(_told(kind, one, cases[one.case], trials[one]) for one in conditions)
        experiment = Experiment(made, told)
        if out is not None:
            write_results(experiment, kind, folder)
    return experiment


def analyse_recordings(
    file: ExperimentFile | Path | str,
    recordings: Sequence[Path | str],
    out: Path | str | None = None,
    *,
    rate: float | None = None,
) -> Experiment:
    """Analyse recordings of people, or other recordings, with the settings of an experiment file, without simulation.

    Args:
        file: the experiment file, its path, or the name of a shipped one; its cases are ignored.
        recordings: files that :func:`icmj.read_series` reads: the trials of one person and condition.
        out: folder for results and figure.
        rate: rows per second of files without times [Hz].

    Raises:
        RunFileError: if the experiment file does not validate.
        DataError: if a recording cannot be read, a column or its unit is missing, or the analysis is not possible.
    """
    made = file if isinstance(file, ExperimentFile) else load_experiment(file)
    kind, trials = kind_of(made), []
    for path in map(Path, recordings):
        try:
            trials.append(Recording(kind.read(read_series(path, rate=rate))))
        except DataError as error:
            raise DataError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from error
    if not trials:
        raise DataError("no recording; give one file at least")
    try:
        finding = kind.analysed(trials)
    except DataError as error:
        which = str(recordings[0]) if len(trials) == 1 else f"{len(trials)} recordings"
        raise DataError(f"{which}: {error}") from error
    name = Path(recordings[0]).stem
    told = Told(name, name, "recording", finding, len(trials), finding.words)
    experiment = Experiment(made, (told,), tuple(Path(path).name for path in recordings))
    if out is not None:
        with resume_experiment(out, made) as folder:
            write_results(experiment, kind, folder)
    return experiment


@dataclass(frozen=True)
class Condition:
    """One case on one plant.

    Attributes:
        case, title: name of the case, and its title in tables.
        plant: ``linear`` or ``mujoco``.
        table: its table in the experiment file.
        run: its run file.
    """

    case: str
    title: str
    plant: PlantKind
    table: CaseTable
    run: RunFile

    def __hash__(self) -> int:
        return hash((self.case, self.plant))

    @property
    def label(self) -> str:
        """Case and plant, as stored trials are called."""
        return f"{self.case}.{self.plant}"

    def trigger(self, case: Case) -> Trigger | None:
        """The trigger that replaces that of the case."""
        if self.table.control == "continuous":
            controller = expect_prediction(case, 'control = "continuous"').controller
            return continuous_limit(controller, case.settings.share_interval)
        return None if self.table.interval is None else ClockTrigger(self.table.interval)


def conditions_of(file: ExperimentFile) -> Iterator[Condition]:
    """Every case on every plant that it has.

    Raises:
        RunFileError: if a case has no plant, or another controller where it has no such thing.
    """
    for name, title, table, run in zip(file.names, file.titles, file.case, file.runs, strict=True):
        if table.control != "own" and not run.has_events:
            raise RunFileError(
                f"{file.path}: case {name!r}: a controller of kind {run.controller.kind!r} has no events"
            )
        plants = [plant for plant in file.experiment.plants if plant == "linear" or run.on_engine]
        if not plants:
            raise RunFileError(f"{file.path}: case {name!r}: its plant is given by matrices; add the linear plant")
        for plant in plants:
            yield Condition(name, title, plant, table, run)


def _prepared(kind: Kind, one: Condition, seed: int) -> Case:
    """The case of its first trial; errors come before anything is simulated."""
    return prepare(kind.stimulated(one.run, seed))


def _trials(
    file: ExperimentFile,
    kind: Kind,
    conditions: Sequence[Condition],
    folder: Folder,
    jobs: int | None,
    progress: Tell | None,
) -> dict[Condition, list[Recording]]:
    """The trials of every condition, in order: read where they are done, else simulated."""
    count, first = file.experiment.repetitions, file.experiment.seed
    every = [(one, i) for one in conditions for i in range(count)]
    known = {(one, i): found for one, i in every if (found := read_trial(folder, one.label, i)) is not None}
    left = [each for each in every if each not in known]
    jobs = processes(jobs, len(left))

    def keep(place: int, found: Recording) -> None:
        one, i = left[place]
        known[one, i] = found
        write_trial(folder, one.label, i, found)

    def tell(done: float) -> None:
        if progress is not None:
            whole = (len(every) - len(left) + done) / len(every)
            progress(f"{file.experiment.name}, {len(known)} of {len(every)} trials", 0.95 * whole)

    work = [(kind, one, first + i) for one, i in left]
    if jobs == 1:
        for place, arguments in enumerate(work):
            keep(place, trial(*arguments))
            tell(place + 1)
    else:
        done = np.zeros(len(work))
        with Workers(jobs) as workers:
            for news in workers.run(
                Task(f"{one.case}, trial {seed}", trial, (kind, one, seed)) for kind, one, seed in work
            ):
                done[news.index] = news.done
                if news.value is not None:
                    keep(news.index, news.value)
                tell(float(done.sum()))
    return {one: [known[one, i] for i in range(count)] for one in conditions}


@single_threaded()
def trial(kind: Kind, one: Condition, seed: int, progress: Callable[[float], None] | None = None) -> Recording:
    """One trial of a case on a plant."""
    case = LAST.get(kind.stimulated(one.run, seed))
    case = replace(case, settings=reseeded(case.settings, seed))
    found = simulate(case, one.plant, trigger=one.trigger(case), progress=progress)
    whole = found.outcome.kind not in ("fell", "diverged", "interrupted")
    # what stands for continuous control is a clock of a few milliseconds, whose ticks are no events
    events = found.events.t[:0] if one.table.control == "continuous" else found.events.t
    return Recording(kind.recorded(case, found), events.copy(), "completed" if whole else found.outcome.kind)


def _controlled(one: Condition, case: Case) -> Case:
    """The case with the controller of this condition."""
    if (trigger := one.trigger(case)) is not None:
        return replace(case, controller=expect_prediction(case, "another trigger").controller.triggered_by(trigger))
    return case


def _told(kind: Kind, one: Condition, case: Case, trials: Sequence[Recording]) -> Told:
    """The result of the analysis or, if there is none, the reason."""
    try:
        finding = kind.analysed(trials, _controlled(one, case), one.plant)
        return Told(one.case, one.title, one.plant, finding, len(trials), finding.words)
    except IcmjError as error:
        return Told(one.case, one.title, one.plant, None, len(trials), f"no conclusion, because {error}")
