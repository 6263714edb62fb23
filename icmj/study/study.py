"""The study: every case on both plants into logs, then one report and one summary from the logs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.base.files import write_text
from icmj.errors import ReportError, RunFileError
from icmj.runfile.reading import load_run
from icmj.runfile.schema import RunFile

if TYPE_CHECKING:
    from icmj.case.case import Case, PlantKind
    from icmj.comparison.comparison import Comparison
    from icmj.result.attractor import Attractor
    from icmj.result.result import Result

PLANTS: tuple[PlantKind, ...] = ("linear", "mujoco")
Progress = Callable[[str, float], None]
AFTER_INTERRUPT = 30.0  # [s] of continuous control beside a run that was interrupted: enough to see it settle


@dataclass(frozen=True)
class Outputs:
    """Files of a study.

    Attributes:
        logs: one for each case and plant.
        report: the HTML page.
        summary: ``summary.json``.
        comparisons: the rows of the table.
    """

    logs: tuple[Path, ...]
    report: Path
    summary: Path
    comparisons: tuple[Comparison, ...]


def find_runs(paths: Sequence[Path]) -> tuple[RunFile, ...]:
    """Load run files; a folder stands for all ``*.toml`` in it.

    Raises:
        RunFileError: if there is none, one is not valid, or two have the same case name.
    """
    files: list[Path] = []
    for path in paths:
        found = sorted(path.glob("*.toml")) if path.is_dir() else [path]
        if not found:
            raise RunFileError(f"{path}: no run file (*.toml) in this folder")
        files += found
    runs = tuple(load_run(file) for file in files)
    seen: dict[str, Path] = {}
    for run in runs:
        if run.case.name in seen:
            raise RunFileError(f"{run.path}: case.name {run.case.name!r} is taken by {seen[run.case.name]}; rename one")
        seen[run.case.name] = run.path
    return runs


def run_case(run: RunFile, plant: PlantKind, progress: Callable[[float], None] | None = None) -> Result:
    """One case on one plant, complete: prediction, run, continuous control, growth, amplitude law, poses.

    A run that is interrupted keeps what was simulated until then, and leaves out what would take long.

    Raises:
        IcmjError: if the run file, its models, the design or the analysis fail.
    """
    from icmj.case.case import prepare, simulate
    from icmj.controller.controller import continuous_limit
    from icmj.engine.pose import scene
    from icmj.experiment.amplitude_law import measure_law
    from icmj.experiment.growth import measure_growth
    from icmj.measurement.measurement import measure
    from icmj.measurement.statistics import statistics
    from icmj.result.result import Result
    from icmj.study.provenance import provenance

    def report(done: float) -> None:
        if progress is not None:
            progress(done)

    case = prepare(run)
    report(0.1)
    simulation = simulate(case, plant, progress=lambda done: report(0.1 + 0.4 * done))
    interrupted = simulation.outcome.kind == "interrupted"
    continuous = simulate(
        case,
        plant,
        trigger=continuous_limit(case.controller),
        duration=min(simulation.outcome.t, AFTER_INTERRUPT) if interrupted else None,
        progress=lambda done: report(0.5 + 0.1 * done),
    )
    growth = law = None
    found: tuple[Attractor, ...] = ()
    if not interrupted:
        growth = measure_growth(case, plant, run.study.growth_points)
        report(0.75)
        found = _attractors(case) if plant == "linear" else ()
        law = measure_law(case, run.study.law_q_t) if plant == "mujoco" else None
    report(0.9)
    return Result(
        run=run,
        assumed=case.assumed.linearisation.plant,
        actual=case.actual.linearisation.plant,
        controller=case.controller,
        prediction=case.prediction,
        simulation=simulation,
        continuous=continuous,
        measurement=measure(simulation, T_hat=case.system.T_hat),
        growth=growth,
        law=law,
        attractors=found,
        scene=scene(case.actual, simulation, run.study.magnification),
        provenance=provenance(run.path.parent),
        statistics=statistics(simulation) if simulation.noisy else None,
    )


def _attractors(case: Case) -> tuple[Attractor, ...]:
    from icmj.experiment.attractors import attractors

    study = case.run.study
    if study.attractor_starts == 0:
        return ()
    plant, settings = case.actual.linearisation.plant, case.settings
    return attractors(plant, case.controller, settings, starts=study.attractor_starts, seed=study.seed)


def check(path: Path) -> None:
    """Prepare a case and throw it away: bad input shows before anything is written."""
    from icmj.case.case import prepare

    prepare(load_run(path))


def log_case(path: Path, plant: PlantKind, folder: Path) -> Path:
    """Run one case on one plant and write its log ``<case>.<plant>.rrd`` into ``folder``."""
    from icmj.log import write_log

    run = load_run(path)
    result = run_case(run, plant)
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / f"{run.case.name}.{plant}.rrd"
    write_log(result, log)
    return log


def run_study(
    runs: Sequence[RunFile], out: Path, *, jobs: int | None = None, progress: Progress | None = None
) -> Outputs:
    """Run every case on both plants in ``jobs`` processes, then build the report and the summary from the logs.

    Args:
        runs: the cases.
        out: folder of the outputs; made if it is not there.
        jobs: processes; as many as cores if ``None``.
        progress: called with a label and the fraction of the whole that is done.

    Raises:
        IcmjError: the first error of any case. All inputs are checked before the first log is written.
    """
    if not runs:
        raise RunFileError("no run file given")
    tell = progress or (lambda label, done: None)
    tasks = [(run, plant) for run in runs for plant in PLANTS]
    jobs = max(1, min(jobs or os.cpu_count() or 1, len(tasks)))
    done = 0
    with _pool(jobs) as pool:
        list(pool.map(check, [run.path for run in runs]))
        tell("inputs checked", 0.1)
        futures: dict[Future[Path], str] = {
            pool.submit(log_case, run.path, plant, out): f"{run.case.name} ({plant})" for run, plant in tasks
        }
        try:
            for future in as_completed(futures):
                future.result()
                done += 1
                tell(futures[future], 0.1 + 0.75 * done / len(tasks))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    logs = tuple(out / f"{run.case.name}.{plant}.rrd" for run, plant in tasks)
    tell("report", 0.86)
    comparisons = report(logs, out / "report.html", summary=out / "summary.json")
    tell("done", 1.0)
    return Outputs(logs, out / "report.html", out / "summary.json", comparisons)


def report(logs: Sequence[Path], out: Path, *, summary: Path | None = None) -> tuple[Comparison, ...]:
    """Build the report page, and if asked the summary, from logs alone.

    Raises:
        LogError, ReportError: if a log cannot be read or the page cannot be built.
    """
    from icmj.comparison.comparison import compare, to_json
    from icmj.log import read_log
    from icmj.report import build_report

    results = [read_log(log) for log in logs]
    comparisons = tuple(compare(result) for result in results)
    out.parent.mkdir(parents=True, exist_ok=True)
    build_report(results, out)
    if summary is not None:
        records = json.dumps([to_json(c) for c in comparisons], indent=2, allow_nan=False)
        try:
            write_text(summary, records + "\n")
        except OSError as error:
            raise ReportError(f"{summary}: cannot be written: {error.strerror}") from error
    return comparisons


@contextmanager
def _pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Processes started afresh: MuJoCo's callbacks and numba's threads do not survive a fork."""
    from multiprocessing import get_context

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield pool
