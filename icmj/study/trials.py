"""The folder of an experiment: trials that are done, each whole or not there; its curves, numbers, figure and page."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.card import plain
from icmj.base.files import LOCK, clear_leftovers, locked, ready, whole, write_bytes, write_text
from icmj.base.ledger import SUMS, Ledger
from icmj.base.parquet import read_parquet
from icmj.base.text import one_line, parse_json
from icmj.case.files import digests, fingerprint_of
from icmj.errors import DataError, StudyError
from icmj.experiments.recording import Recording
from icmj.report import style
from icmj.report.experiment import Row, experiment_page
from icmj.runfile.experiment_tables import ExperimentFile
from icmj.series.series import Series
from icmj.series.writing import FORMATS
from icmj.study.kind import Experiment, Kind, Told
from icmj.work.provenance import PACKAGES, provenance

FACTS, TRIALS = "experiment.json", "trials"
_MOST_BYTES, _MOST_ROWS, _MOST_FACTS = 500e6, 10_000_000, 50e6


class Folder:
    """The folder in which trials are stored; without a path, none is stored."""

    def __init__(self, path: Path | None) -> None:
        self._path, self._ledger = path, Ledger(path or Path())

    @property
    def path(self) -> Path:
        """The folder."""
        assert self._path is not None
        return self._path

    def write(self, name: str, index: int, trial: Recording) -> None:
        """Keep a trial: its events first, so that signals that are there are the sign of a whole one.

        Raises:
            StudyError: if it cannot be written.
        """
        if self._path is None:
            return
        signals, events = self._files(name, index)
        try:
            times = np.diff(trial.events, prepend=0.0)[:, None]
            events_of = Series(trial.events, times, ("interval",), ("s",), {"outcome": trial.outcome})
            for series, path in ((events_of, events), (trial.series, signals)):
                with self._ledger.seal(path) as part:
                    FORMATS[path.suffix](series, part)
        except OSError as error:
            raise StudyError(f"{signals}: cannot be written: {error.strerror or error}") from error

    def read(self, name: str, index: int) -> Recording | None:
        """A stored trial; ``None`` if there is none.

        Raises:
            StudyError: if it cannot be read, or was changed.
        """
        if self._path is None:
            return None
        if not self.holds(name, index):
            return None
        signals, events = self._files(name, index)
        path = events
        try:
            found, outcome = self._series(events)
            path = signals
            return Recording(self._series(signals)[0], found.t, outcome)
        except (DataError, OSError, ValueError, LookupError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error, 200)
            raise StudyError(f"{path}: cannot be read: {why}; remove it, and it is simulated again") from error

    def _series(self, path: Path) -> tuple[Series, str]:
        """The series that was written, and the outcome of its run, which is empty where it is with the events."""
        table = read_parquet(self._ledger.read(path, _MOST_BYTES), _MOST_ROWS, _MOST_BYTES)
        if any(field.type != pa.float64() for field in table.schema) or sum(c.null_count for c in table.columns):
            raise ValueError("has a column of something else than numbers")
        t, *values = (column.to_numpy() for column in table.columns)
        units = [(field.metadata or {}).get(b"unit", b"").decode() for field in table.schema]
        series = Series(t, np.column_stack(values), tuple(table.column_names[1:]), tuple(units[1:]))
        return series, (table.schema.metadata or {}).get(b"icmj.outcome", b"").decode()

    def holds(self, name: str, index: int) -> bool:
        """Whether the files of a trial are there."""
        return self._path is not None and all(map(os.path.lexists, self._files(name, index)))

    def _files(self, name: str, index: int) -> tuple[Path, Path]:
        stem = self.path / TRIALS / f"{name}.{index:04d}"
        return stem.with_name(f"{stem.name}.parquet"), stem.with_name(f"{stem.name}.events.parquet")


@contextmanager
def no_folder() -> Iterator[Folder]:
    """Nothing is kept."""
    yield Folder(None)


@contextmanager
def opened(path: Path, file: ExperimentFile) -> Iterator[Folder]:
    """The folder of an experiment, begun or taken up again; nobody else writes to it within the block.

    Raises:
        StudyError: if another process is at it, or it holds another experiment, or one of other versions, or cannot be
            written to.
    """
    made = not path.exists()
    try:
        path.mkdir(parents=True, exist_ok=True)
        with locked(path, "experiment"), _kept_if_begun(path, made):
            ready(path, SUMS)
            _begin(path, file)
            trials = path / TRIALS
            if trials.is_symlink():
                raise StudyError(f"{trials}: is a link, not a folder; choose another --out")
            trials.mkdir(exist_ok=True)
            clear_leftovers(trials)
            yield Folder(path)
    except BlockingIOError as error:
        raise StudyError(f"{path}: {error.strerror}, or choose another --out") from error
    except OSError as error:
        raise StudyError(f"{path}: cannot be written to: {error.strerror}; choose another --out") from error


@contextmanager
def _kept_if_begun(path: Path, made: bool) -> Iterator[None]:
    """Leave no folder behind that was ``made`` for trials of which not one was done, nor results."""
    try:
        yield
    except BaseException:
        if made and not any(child for child in path.rglob("*") if child.name not in (FACTS, LOCK, SUMS, TRIALS)):
            shutil.rmtree(path, ignore_errors=True)
        raise


def _begin(path: Path, file: ExperimentFile) -> None:
    """Say what the folder is of, or see that it is of this."""
    facts, mark = path / FACTS, fingerprint(file)
    if os.path.lexists(facts):
        if _known(facts).get("fingerprint") != mark:
            raise StudyError(
                f"{path}: holds another experiment, or one of another file, model or version; choose another --out"
            )
        return
    record = {
        "fingerprint": mark,
        "name": file.experiment.name,
        "kind": file.kind,
        "provenance": provenance(file.path.parent),
        "experiment": file.text,
        "runs": {name: run.text for name, run in zip(file.names, file.runs, strict=True)},
    }
    with Ledger(path).seal(facts) as part:
        part.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def fingerprint(file: ExperimentFile) -> str:
    """Sixteen hexadecimal digits of all that makes the trials: files, all that these name, versions."""
    now = provenance(file.path.parent)
    identity: dict[str, Any] = {
        "file": file.model_dump(exclude={"experiment": {"title", "repetitions"}}),
        "runs": [run.model_dump() for run in file.runs],
        "files": [digests(run) for run in file.runs],
        "versions": {name: now.get(name) for name in ("icmj", *PACKAGES)},
    }
    return fingerprint_of(identity)


def _known(path: Path) -> dict[str, Any]:
    found, why = None, "no table"
    try:
        found = parse_json(Ledger(path.parent).read(path, _MOST_FACTS))
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    if not isinstance(found, dict):
        raise StudyError(f"{path}: is not what an experiment wrote ({why}); choose another --out")
    return found


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
            "case": told.case,
            "title": told.title,
            "plant": told.plant,
            "trials": told.trials,
            "told": told.finding is not None,
            "words": told.words,
            "numbers": {} if told.finding is None else plain(dict(told.finding.numbers)),
        }
        for told in experiment.found
    ]
    head = experiment.file.experiment
    return {"name": head.name, "kind": experiment.file.kind, "found": found}


def write_results(experiment: Experiment, kind: Kind, folder: Folder) -> None:
    """Write everything but the trials.

    Raises:
        StudyError: if a file cannot be written.
    """
    path = folder.path
    try:
        with whole(path / RESULTS) as part:
            pq.write_table(table(experiment), part)
        write_text(path / SUMMARY, json.dumps(summary(experiment), indent=1, ensure_ascii=False) + "\n")
        svg = _draw(experiment, kind, path)
        write_text(path / PAGE, experiment_page(_title(experiment), experiment.file.kind, _rows(experiment), svg))
    except OSError as error:
        raise StudyError(f"{path}: cannot be written to: {error.strerror}; choose another --out") from error


def _draw(experiment: Experiment, kind: Kind, path: Path) -> bytes | None:
    if not any(told.finding is not None for told in experiment.found):
        return None
    with style.applied():
        figure = kind.drawn(experiment.found)
        svg, png = style.save(figure, "svg"), BytesIO()
        figure.savefig(png, format="png", dpi=200, metadata={"Software": None})
    write_bytes(path / f"{FIGURE}.svg", svg)
    write_bytes(path / f"{FIGURE}.png", png.getvalue())
    return svg


def _title(experiment: Experiment) -> str:
    return experiment.file.experiment.title or experiment.file.experiment.name


def _rows(experiment: Experiment) -> list[Row]:
    return [_row(told) for told in experiment.found]


def _row(told: Told) -> Row:
    numbers = {} if told.finding is None else dict(told.finding.numbers)
    return Row(told.title, told.plant, told.trials, numbers, told.words)
