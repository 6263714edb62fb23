"""A report's page and summary, made from logs.

Figures of several cases are drawn side by side.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.base.files import make_ready, write_text
from icmj.errors import ReportError, explain_refusal
from icmj.work.workers import Task, Tell, Workers

if TYPE_CHECKING:
    from icmj.case.comparison import Comparison
    from icmj.case.result import Result
    from icmj.case.sweep_table import SweepTable
    from icmj.cycle.branch import Branch
    from icmj.report.case_runs import CaseRuns


@dataclass(frozen=True)
class Page:
    """The contents of a page.

    Attributes:
        comparisons: of runs beside their prediction.
        others: runs under controllers without a prediction.
    """

    comparisons: tuple[Comparison, ...]
    others: tuple[Result, ...]


def report(
    logs: Sequence[Path],
    out: Path,
    *,
    summary: Path | None = None,
    sweeps: Sequence[SweepTable] = (),
    branches: Sequence[Branch] = (),
    workers: Workers | None = None,
    progress: Tell | None = None,
) -> Page:
    """Build the report page, and if asked the summary, from logs alone, and from sweeps and branches of cycles.

    Args:
        logs: of runs; those of one case on both plants are shown together.
        out: the page.
        summary: file of the comparisons.
        sweeps, branches: shown after the runs, or alone.
        workers: draw the figures of several cases side by side; without them, or of two cases, they are drawn here.
        progress: called with the part that is done, 0–1.

    Raises:
        LogError, ReportError: if a log cannot be read or the page cannot be built.
    """
    from icmj.case.comparison import compare, to_json, to_record
    from icmj.log.figure import read_scene
    from icmj.log.reader import read_log
    from icmj.report.builder import build_report

    tell = progress or (lambda part: None)
    results: list[Result] = []
    of_case: dict[str, list[Path]] = {}
    for number, log in enumerate(logs, 1):
        result = replace(read_log(log), scene=read_scene(log))
        results.append(result)
        if result.prediction is not None:
            of_case.setdefault(result.run.case.name, []).append(log)
        tell(0.2 * number / len(logs))
    comparisons = tuple(compare(result) for result in results if result.prediction is not None)
    others = tuple(result for result in results if result.prediction is None)
    with explain_refusal(ReportError, f"{out}: the report cannot be written"):
        make_ready(out.parent)
    draw = None
    if workers is not None and len(of_case) > 2:

        def draw(cases: Sequence[CaseRuns], folder: Path) -> None:
            tasks = [Task(case.name, draw_logs, (tuple(of_case[case.name]), folder)) for case in cases]
            done = [0.0] * len(tasks)
            for news in workers.run(tasks):
                done[news.index] = news.done
                tell(0.2 + 0.7 * sum(done) / len(tasks))

    build_report(results, out, sweeps=sweeps, branches=branches, draw=draw)
    if summary is not None:
        records = json.dumps([*map(to_json, comparisons), *map(to_record, others)], indent=2, allow_nan=False)
        with explain_refusal(ReportError, f"{summary}: cannot be written"):
            write_text(summary, records + "\n")
    return Page(comparisons, others)


def draw_logs(logs: Sequence[Path], folder: Path, progress: Tell | None = None) -> None:
    """Draw the figures of the case that logs are of into ``folder``: what a worker does for the page."""
    from icmj.log.reader import read_log
    from icmj.report.case_runs import pair
    from icmj.report.drawing import draw_case

    for case in pair([read_log(log) for log in logs]):
        draw_case(case, folder)
