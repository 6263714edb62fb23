"""What an experiment leaves in its folder: one Parquet of the curves, the numbers, the figure, and a page."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.card import plain
from icmj.base.files import whole, write_bytes, write_text
from icmj.errors import StudyError
from icmj.report import style
from icmj.report.experiment import Row, experiment_page
from icmj.study.kind import Experiment, Kind, Told
from icmj.study.trials import Folder

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
