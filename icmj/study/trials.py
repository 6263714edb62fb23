"""The folder of an experiment: trials that are done, each whole or not there; its curves, numbers, figure and page."""

from __future__ import annotations

import json
import os
from contextlib import AbstractContextManager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.card import plain
from icmj.base.files import whole, write_bytes, write_text
from icmj.base.parquet import read_parquet
from icmj.case.files import digests
from icmj.errors import StudyError
from icmj.experiments.recording import Recording
from icmj.report import style
from icmj.report.experiment import Row, experiment_page
from icmj.runfile.experiment_tables import ExperimentFile
from icmj.series.series import Series
from icmj.series.writing import FORMATS
from icmj.study.kind import Experiment, Kind, Told
from icmj.work.folder import Description, Folder, fingerprint_of, resume
from icmj.work.provenance import provenance

TRIALS = "trials"
_MOST_BYTES, _MOST_ROWS = 500e6, 10_000_000


def resume_experiment(path: Path | str | None, file: ExperimentFile) -> AbstractContextManager[Folder]:
    """The folder of an experiment, new or taken up again; a temporary one without a path.

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
    mark = {"fingerprint": fingerprint(file)}
    of = Description("experiment", TRIALS, mark, "experiment file, run file, model or code", more)
    return resume(path, of, StudyError, again="simulated")


def fingerprint(file: ExperimentFile) -> str:
    """Sixteen hexadecimal digits of all that makes the trials, except versions of software."""
    identity: dict[str, Any] = {
        "file": file.model_dump(exclude={"experiment": {"title", "repetitions"}}),
        "runs": [run.model_dump() for run in file.runs],
        "files": [digests(run) for run in file.runs],
    }
    return fingerprint_of(identity)


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
            FORMATS[path.suffix](series, part)


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
        file = experiment.file
        rows = _rows(experiment)
        page = experiment_page(_title(experiment), file.kind, file.settings, rows, svg, experiment.recordings)
        write_text(path / PAGE, page)
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
    finding = told.finding
    numbers, deviations = ({}, {}) if finding is None else (dict(finding.numbers), dict(finding.deviations))
    return Row(told.title, told.plant, told.trials, numbers, told.words, deviations)
