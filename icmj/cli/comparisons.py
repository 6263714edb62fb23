"""Runs beside their predictions, as several commands show them: one table for people, one record for programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from icmj.base.numbers import number, relative
from icmj.case.comparison import Comparison, to_json, to_record
from icmj.cli.table import Column, show_table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from icmj.case.result import Result
    from icmj.cli.terminal import Terminal
    from icmj.study.page import Page

KINDS = {
    "homoclinic": "homoclinic: the last open-loop intervals grow, each longer than the one before, and the motion "
    "settles on no cycle.",
    "growth": "growth: the motion grows until the body falls, or to the end of the run.",
}
COLUMNS = (
    Column("case"),
    Column("plant"),
    Column("Δ_crit", "right"),
    Column("measured", "right"),
    Column("error", "right"),
    Column("peak error", "right", 2),
    Column("cycle", "center", 1),
)


def show_page(page: Page, out: Terminal, *, changed: bool = False) -> None:
    """Print the contents of a report: a table of runs with a prediction, and one sentence for each other run."""
    if page.comparisons:
        show_comparisons(page.comparisons, out, changed=changed)
    for other in page.others:
        changes = f" {other.run.changes_in_words}" if other.run.changes else ""
        out.say(f"{other.run.case.name} ({other.simulation.plant}): {other.words}{changes}")


def show_comparisons(comparisons: Sequence[Comparison], out: Terminal, *, changed: bool = False) -> None:
    """The table (cycle: settled on the predicted one), and beneath it the verdict of every run that did not.

    Args:
        comparisons: a row for each.
        out: where they are printed.
        changed: whether --set changed the run files, so that nobody needs to be told that the paper has other values.
    """
    rows = [
        (
            c.case,
            c.plant,
            _critical(c),
            number(c.measured.interval, 6) if c.measured.kind == "cycle" else c.measured.kind,
            relative(c.relative_error.interval if c.measured.converged else None),
            relative(c.relative_error.largest_amplitude if c.measured.converged else None),
            "yes" if c.measured.converged else "no",
        )
        for c in comparisons
    ]
    brackets = "; in brackets: no cycle is predicted" * any(row[2].startswith("(") for row in rows)
    show_table(COLUMNS, rows, out, title=f"Predicted and measured open-loop interval, in seconds{brackets}", keys=2)
    for kind, words in KINDS.items():
        if any(row[3] == kind for row in rows):
            out.say(words)
    for case, changes in {c.case: c.changes for c in comparisons if c.changes}.items():
        out.say(f"{case}: {changes[:1].lower()}{changes[1:]}")
    for notice in collect_notes(comparisons):
        if not (changed and ": paper: " in notice):
            out.note(notice)
    for c in comparisons:
        if not c.measured.converged:
            out.say(f"{c.case} ({c.plant}): {c.words}")


def _critical(c: Comparison) -> str:
    """Δ_crit, in brackets where no cycle is predicted."""
    text = number(c.predicted.delta_crit, 6)
    return text if c.predicted.cycle or c.predicted.delta_crit is None else f"({text})"


def collect_notes(comparisons: Sequence[Comparison]) -> Iterator[str]:
    """Notes on the runs without repetition: a note that all runs of a case share is printed once for the case."""
    runs = {c.case: [other for other in comparisons if other.case == c.case] for c in comparisons}
    for case, same in runs.items():
        for notice in dict.fromkeys(notice for c in same for notice in c.notices):
            having = [c.plant for c in same if notice in c.notices]
            yield f"{case}: {notice}" if len(having) == len(same) > 1 else f"{case} ({having[0]}): {notice}"


def plain_runs(runs: Iterable[Comparison | Result], **files: Path | Iterable[Path]) -> dict[str, Any]:
    """What ``--json`` prints of runs: each as in ``summary.json``; and the files written."""
    written = {
        kind: str(file) if isinstance(file, Path) else [str(one) for one in file] for kind, file in files.items()
    }
    records = [to_json(run) if isinstance(run, Comparison) else to_record(run) for run in runs]
    return {"runs": records, **written}
