"""The experiment: trials of each case on each plant, side by side in several processes, kept, analysed and drawn.

    OUT/experiment.json   what it is of (:mod:`icmj.work.folder`)
    OUT/trials/           the signals of each trial, and its events, as Parquet: what stands there is done
    OUT/results.parquet   the curves that were found, by case and plant
    OUT/summary.json      the numbers
    OUT/figure.png, .svg, report.html

What an experiment is, its kind says (:mod:`icmj.study.kind`). The trials of a folder are recordings like anybody's:
``icmj experiment FILE --recording OUT/trials/…`` analyses them again.

The folder of an experiment holds trials that are done, each whole or not there; its curves, numbers, figure and page.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.array import is_between
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.files import whole, write_bytes, write_text
from icmj.base.numbers import pick, plain
from icmj.base.parquet import read_parquet
from icmj.case.case import Case, PlantKind, expect_rule, prepare, simulate
from icmj.case.references import digests
from icmj.controller.controller import continuous_limit
from icmj.controller.trigger import ClockTrigger, Trigger
from icmj.errors import DataError, IcmjError, RunFileError, StudyError, explain_refusal
from icmj.experiments.many import LAST
from icmj.experiments.recording import Recording
from icmj.report import style
from icmj.report.experiment import Row, experiment_page
from icmj.runfile.schema import RunFile
from icmj.series.even_rows import expect_rate
from icmj.series.long_table import label_of
from icmj.series.plausibility import note_oddities
from icmj.series.reading import read_long_table
from icmj.series.series import SETTLED, Series
from icmj.series.writing import find_writers
from icmj.simulation.settings import reseed
from icmj.study.estimate import refuse_trials
from icmj.study.experiment_file import CaseTable, ExperimentFile, load_experiment
from icmj.study.kind import CaseResult, Kind, at_work
from icmj.work.folder import Description, Folder, digest_of, fingerprint_of, resume
from icmj.work.own_code import Code
from icmj.work.provenance import provenance
from icmj.work.workers import Task, do, processes

TRIALS = "trials"
_MOST_BYTES, _MOST_ROWS = 500e6, 10_000_000


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


def resume_experiment(
    path: Path | str | None, file: ExperimentFile, recordings: Sequence[Mapping[str, Any]] = ()
) -> AbstractContextManager[Folder]:
    """The folder of an experiment, new or taken up again; a temporary one without a path.

    Args:
        path: of the folder.
        file: the experiment.
        recordings: names, digests and parts of the files that are analysed, in whose place nothing is simulated.

    Raises:
        StudyError: as :func:`icmj.work.folder.resume`.
    """
    more = {
        "name": file.experiment.name,
        "kind": file.kind,
        "provenance": provenance(file.path.parent),
        "experiment": file.text,
        "runs": {name: run.text for name, run in zip(file.names, file.runs, strict=True)},
    }
    mark: dict[str, Any] = {"fingerprint": fingerprint(file)}
    if recordings:
        analysed = file.model_dump(exclude={"case": True, "experiment": {"title", "repetitions"}})
        mark = {"fingerprint": fingerprint_of({"file": analysed} | _own_sources(file)), "recordings": list(recordings)}
    of = Description("experiment", TRIALS, mark, lambda known: _find_another(known, mark), more)
    return resume(path, of, StudyError, again="simulated")


def _find_another(known: Mapping[str, Any], mark: Mapping[str, Any]) -> str:
    """What results are of whose description is not this, in words: an experiment file, or recordings by their names."""
    ours, theirs = mark.get("recordings", []), known.get("recordings", [])
    theirs = [one for one in theirs if isinstance(one, dict)] if isinstance(theirs, list) else []
    if not ours:
        return "recordings" if theirs else "another experiment file, run file, model or code"
    if not theirs:
        return "simulations"
    if known.get("fingerprint") != mark["fingerprint"]:
        return "another experiment file"
    names, digests = ([[str(one.get(key)) for one in each] for each in (ours, theirs)] for key in ("name", "sha256"))
    if names[0] != names[1]:
        return f"the recordings {', '.join(names[1])}"
    changed = [name for name, now, before in zip(names[0], *digests, strict=True) if now != before]
    return f"{', '.join(changed)}, changed since" if changed else f"another part or rate of {', '.join(names[0])}"


def fingerprint(file: ExperimentFile) -> str:
    """Sixteen hexadecimal digits of all that makes the trials, except versions of software."""
    identity: dict[str, Any] = {
        "file": file.model_dump(exclude={"experiment": {"title", "repetitions"}}),
        "runs": [run.model_dump() for run in file.runs],
        "files": [digests(run) for run in file.runs],
    }
    return fingerprint_of(identity | _own_sources(file))


def _own_sources(file: ExperimentFile) -> dict[str, Any]:
    """Digests of the user's own code, of a kind or of what its keys name."""
    own, code = [name for name in (file.kind, *file.settings.references) if ":" in name], Code(file.path.parent, True)
    digests_of = [[code.digest(name), *(digest_of(path) for path in code.sources(name))] for name in own]
    return {"code": [one for each in digests_of for one in each]} if own else {}


def has_trial(path: Path, name: str, index: int) -> bool:
    """Whether the files of a trial are in a folder."""
    return all(map(os.path.lexists, _files(path, name, index)))


def write_trial(folder: Folder, name: str, index: int, trial: Recording) -> None:
    """Keep a trial: its events first, so that signals that are there are the sign of a whole one.

    Raises:
        StudyError: if it cannot be written.
    """
    signals, events = _files(folder.path, name, index)
    times = np.diff(trial.events, prepend=0.0)[:, None]
    events_of = Series(trial.events, times, ("interval",), ("s",), {"outcome": trial.outcome})
    for series, path in ((events_of, events), (trial.series, signals)):
        with folder.seal(path) as part:
            find_writers()[path.suffix](series, part)


def read_trial(folder: Folder, name: str, index: int) -> Recording | None:
    """A trial of a folder; ``None`` if there is none.

    Raises:
        StudyError: if it cannot be read, or was changed.
    """
    if not has_trial(folder.path, name, index):
        return None
    signals, events = (folder.read(path, _MOST_BYTES, _series) for path in _files(folder.path, name, index))
    return Recording(signals, events.t, events.facts.get("outcome", ""))


def _series(content: bytes) -> Series:
    """The series that was written; the facts of that of events say how the run ended."""
    table = read_parquet(content, _MOST_ROWS, _MOST_BYTES)
    if any(field.type != pa.float64() for field in table.schema) or sum(c.null_count for c in table.columns):
        raise ValueError("has a column of something else than numbers")
    t, *values = (column.to_numpy() for column in table.columns)
    units = [(field.metadata or {}).get(b"unit", b"").decode() for field in table.schema]
    outcome = (table.schema.metadata or {}).get(b"icmj.outcome", b"").decode()
    names = tuple(table.column_names[1:])
    return Series(t, np.column_stack(values), names, tuple(units[1:]), {"outcome": outcome} if outcome else {})


def _files(path: Path, name: str, index: int) -> tuple[Path, Path]:
    stem = path / TRIALS / f"{name}.{index:04d}"
    return stem.with_name(f"{stem.name}.parquet"), stem.with_name(f"{stem.name}.events.parquet")


RESULTS, SUMMARY, FIGURE, PAGE = "results.parquet", "summary.json", "figure", "report.html"


def table(experiment: Experiment) -> pa.Table:
    """The curves of all cases and plants as one table, one below the other."""
    parts = []
    for told in experiment.found:
        if told.finding is None:
            continue
        curves = told.finding.curves
        rows = len(next(iter(curves.values()), ()))
        named = {"case": pa.array([told.case] * rows), "plant": pa.array([told.plant] * rows)}
        parts.append(pa.table(named | {name: pa.array(np.asarray(values)) for name, values in curves.items()}))
    return pa.concat_tables(parts, promote_options="default") if parts else pa.table({"case": [], "plant": []})


def summary(experiment: Experiment) -> dict[str, object]:
    """The numbers of all cases and plants, for programs; ``null`` if there is no number."""
    found = [
        {
            **pick(told, "case", "title", "plant", "trials"),
            "told": told.finding is not None,
            "words": told.words,
            "numbers": {} if told.finding is None else plain(dict(told.finding.numbers)),
        }
        for told in experiment.found
    ]
    head = experiment.file.experiment
    return {"name": head.name, "kind": experiment.file.kind, "found": found, "notes": list(experiment.notes)}


def write_results(experiment: Experiment, kind: Kind, folder: Folder) -> None:
    """Write everything but the trials.

    Raises:
        StudyError: if a file cannot be written.
    """
    path = folder.path
    with at_work(kind):
        curves, numbers, rows = table(experiment), summary(experiment), list(map(_row, experiment.found))
    with explain_refusal(StudyError, f"{path}: cannot be written to", "; choose another --out"):
        with whole(path / RESULTS) as part:
            pq.write_table(curves, part)
        write_text(path / SUMMARY, json.dumps(numbers, indent=1, ensure_ascii=False) + "\n")
        svg = _draw(experiment, kind, path)
        title = experiment.file.experiment.title or experiment.file.experiment.name
        with at_work(kind):
            page = experiment_page(title, kind, rows, svg, experiment.recordings, experiment.notes)
        write_text(path / PAGE, page)


def _draw(experiment: Experiment, kind: Kind, path: Path) -> bytes | None:
    if not any(told.finding is not None for told in experiment.found):
        return None
    with style.apply():
        with at_work(kind):
            figure = kind.draw(experiment.found)
        svg, png = style.save(figure, "svg"), BytesIO()
        figure.savefig(png, format="png", dpi=200, metadata={"Software": None})
    write_bytes(path / f"{FIGURE}.svg", svg)
    write_bytes(path / f"{FIGURE}.png", png.getvalue())
    return svg


def _row(told: CaseResult) -> Row:
    finding = told.finding
    numbers, deviations = ({}, {}) if finding is None else (dict(finding.numbers), dict(finding.deviations))
    return Row(told.title, told.plant, told.trials, numbers, told.words, deviations)


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
    kind, conditions = made.settings, list(conditions_of(made))
    cases = {one.case: _prepare(kind, one, made.experiment.seed) for one in conditions}
    if longest is not None:
        work, count = [], made.experiment.repetitions
        for one in conditions:
            stored = sum(out is not None and has_trial(Path(out), one.label, i) for i in range(count))
            work.append((_set_controller(one, cases[one.case]), one.plant, count - stored))
        refuse_trials(made.path, work, processes(jobs), longest)
    with resume_experiment(out, made) as folder:
        trials = _trials(made, kind, conditions, folder, jobs, progress)
        if progress is not None:
            progress("analysing", 0.97)
        told = tuple(_analyse(kind, one, cases[one.case], trials[one]) for one in conditions)
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
    since: float | None = None,
    until: float | None = None,
) -> Experiment:
    """Analyse recordings of people, or other recordings, with the settings of an experiment file, without simulation.

    Of each, the part is taken that the file asks for: a key that it leaves out (``settle``, ``duration``, ``periods``,
    ``rate``) leaves nothing out and resamples nothing, whatever its default in simulations is.

    Args:
        file: the experiment file, its path, or the name of a shipped one; its cases are ignored.
        recordings: files that :func:`icmj.series.read_long_table` reads: trials of one person and condition, or
            of several, if columns of the files name them; each person and condition then has a result.
        out: folder for results and figure, of these recordings alone.
        rate: rows per second of files without times [Hz].
        since, until: times [s] before and after which rows of every recording are left out.

    Raises:
        RunFileError: if the experiment file does not validate.
        DataError: if a recording cannot be read, a column or its unit is missing, it is shorter than the file asks for,
            or the analysis is not possible.
        StudyError: if the folder holds another experiment, or one on other recordings.
    """
    made = file if isinstance(file, ExperimentFile) else load_experiment(file)
    kind, groups, notes, same = made.settings, dict[str, list[Recording]](), list[str](), dict[bytes, str]()
    for path in map(Path, recordings):
        where = str(path)
        try:
            for series in read_long_table(path, rate=rate, since=since, until=until):
                label = label_of(series)
                where = ", ".join(filter(None, (str(path), label)))
                with at_work(kind):
                    read = note_oddities(kind.read(expect_rate(series, rate)))
                if (values := read.values.tobytes()) in same:
                    raise DataError(
                        f"holds the same values as {same[values]}; a copy is no further trial, leave it out"
                    )
                same[values] = where
                groups.setdefault(label_of(series, ("person", "condition")), []).append(Recording(read))
                name = ", ".join(filter(None, (path.name, label)))
                notes += [f"{name}: {remark}" for remark in read.remarks]
        except DataError as error:
            raise DataError(str(error) if str(error).startswith(str(path)) else f"{where}: {error}") from error
    if not groups:
        raise DataError("no recording; give one file at least")
    found = []
    for label, trials in groups.items():
        try:
            with at_work(kind):
                finding = kind.analyse(trials)
                words = finding.words
        except DataError as error:
            which = str(recordings[0]) if len(trials) == 1 else f"{len(trials)} recordings"
            raise DataError(f"{', '.join(filter(None, (which, label)))}: {error}") from error
        name = label or Path(recordings[0]).stem
        found.append(CaseResult(name, name, "recording", finding, len(trials), words))
    experiment = Experiment(made, tuple(found), tuple(Path(path).name for path in recordings), tuple(notes))
    if out is not None:
        part = {"rate": rate, "since": since, "until": until}
        sources = [{"name": Path(path).name, "sha256": digest_of(Path(path)), **part} for path in recordings]
        with resume_experiment(out, made, sources) as folder:
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
            controller = expect_rule(case, 'control = "continuous"')
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
                f"{file.path}: case {name!r} has a controller of kind {run.controller.kind!r}, which has no events"
            )
        plants = [plant for plant in file.experiment.plants if plant == "linear" or run.on_engine]
        if not plants:
            raise RunFileError(f"{file.path}: case {name!r} has a plant given by matrices; add the linear plant")
        for plant in plants:
            yield Condition(name, title, plant, table, run)


def _prepare(kind: Kind, one: Condition, seed: int) -> Case:
    """The case of its first trial; errors come before anything is simulated."""
    with at_work(kind):
        run = kind.stimulate(one.run, seed)
    return prepare(run)


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
    folder.expect_readable(path for one, i in every for path in _files(folder.path, one.label, i))
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

    work, done = [(one, first + i) for one, i in left], np.zeros(len(left))
    for news in do([Task(f"{one.case}, trial {seed}", trial, (kind, one, seed)) for one, seed in work], jobs):
        done[news.index] = news.done
        if news.value is not None:
            keep(news.index, news.value)
        tell(float(done.sum()))
    return {one: [known[one, i] for i in range(count)] for one in conditions}


@limit_to_one_thread()
def trial(kind: Kind, one: Condition, seed: int, progress: Callable[[float], None] | None = None) -> Recording:
    """One trial of a case on a plant."""
    with at_work(kind):
        run, begin = kind.stimulate(one.run, seed), kind.begin
    case = LAST.get(run)
    case = replace(case, settings=reseed(case.settings, seed))
    found = simulate(case, one.plant, trigger=one.trigger(case), progress=progress)
    whole = found.outcome.kind not in ("fell", "diverged", "interrupted")
    # what stands for continuous control is a clock of a few milliseconds, whose ticks are no events
    events = found.events.t[:0] if one.table.control == "continuous" else found.events.t
    events = events[is_between(events, begin)] - begin
    with at_work(kind):
        signals = kind.record(case, found)
        signals = replace(signals, facts={**signals.facts, SETTLED: f"{begin:g} s are left out"})
    return Recording(signals, events, "completed" if whole else found.outcome.kind)


def _set_controller(one: Condition, case: Case) -> Case:
    """The case with the controller of this condition."""
    if (trigger := one.trigger(case)) is not None:
        return replace(case, controller=expect_rule(case, "another trigger").triggered_by(trigger))
    return case


def _analyse(kind: Kind, one: Condition, case: Case, trials: Sequence[Recording]) -> CaseResult:
    """The result of the analysis or, if there is none, the reason."""
    try:
        with at_work(kind):
            finding = kind.analyse(trials, _set_controller(one, case), one.plant)
            return CaseResult(one.case, one.title, one.plant, finding, len(trials), finding.words)
    except IcmjError as error:
        return CaseResult(one.case, one.title, one.plant, None, len(trials), f"no conclusion, because {error}")
