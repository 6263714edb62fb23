"""The study: every case on both plants into logs, then one report and one summary from the logs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from icmj.base.files import clear_leftovers, make_ready
from icmj.errors import LogError, RunFileError, SimulationError, expect, explain_refusal, prefix_errors
from icmj.runfile.schema import RunFile
from icmj.work.workers import Task, Tell, Workers, processes

if TYPE_CHECKING:
    from icmj.case.case import Case, PlantKind
    from icmj.case.result import Attractor, Result
    from icmj.simulation.simulation import Simulation

from icmj.study.page import Page, report

PLANTS: tuple[PlantKind, ...] = ("linear", "mujoco")
Progress = Callable[[str, float], None]
_CHECKS = 0.02  # of the whole, about
_LEAST, _PAGE = {"linear": 0.3, "mujoco": 0.8}, 1.4  # s of a run that is plainly quick, and of a case on the page
AFTER_INTERRUPT = 30.0  # [s] of continuous control beside a run that was interrupted: enough to see it settle


@dataclass(frozen=True)
class Outputs:
    """Files of a study.

    Attributes:
        logs: the logs, one for each case and plant.
        report: the HTML page.
        summary: the file ``summary.json``.
        page: the contents of both.
    """

    logs: tuple[Path, ...]
    report: Path
    summary: Path
    page: Page


def plants_of(run: RunFile) -> tuple[PlantKind, ...]:
    """The plants that a case can be simulated on: the linear one alone where it is given by matrices."""
    return PLANTS if run.on_engine else PLANTS[:1]


def run_case(
    run: RunFile | Case,
    plant: PlantKind,
    progress: Callable[[float], None] | None = None,
    *,
    study: bool = False,
) -> Result:
    """Run one case on one plant: its simulation, the measured motion and, under noise, distributions.

    Args:
        run: the case, or its run file.
        plant: ``linear`` or ``mujoco``.
        progress: called repeatedly with the completed fraction, 0–1.
        study: whether what the study adds beside a prediction is computed, too: the run under continuous control,
            growth under a clock, and the amplitude law (MuJoCo) or the search for attractors (linear plant). If this is
            interrupted, the run up to this moment is kept, and what of it takes much time is left out.

    Raises:
        IcmjError: if the run file, its models, the design or the analysis fail.
    """
    from icmj.case.case import Case, expect_measures, measure_own, prepare, simulate
    from icmj.case.result import Result
    from icmj.engine.pose import make_scene
    from icmj.measurement.measurement import measure
    from icmj.simulation.scene import select_frames
    from icmj.simulation.simulation import list_remarks
    from icmj.study.pressure import measure_pressure
    from icmj.work.provenance import provenance

    report: Callable[[float], None] = progress or (lambda _: None)
    case = prepare(run) if isinstance(run, RunFile) else run
    expect(case, Case, "run_case", "or a RunFile")
    run = case.run
    expect_measures(run)
    report(0.1)
    with prefix_errors(run.path):
        theory = case.theory
        share = 0.4 if study and theory else 0.8
        simulation = simulate(case, plant, progress=lambda done: report(0.1 + share * done))
        found = dict[str, Any]()
        if theory:
            found["measurement"] = measure(simulation, T_hat=theory.system.T_hat)
            if simulation.noisy:
                from icmj.measurement.statistics import statistics

                found["statistics"] = statistics(simulation)
            if study:
                found |= _beside(case, plant, simulation, report)
        report(0.9)
        return Result(
            run=run,
            assumed=case.assumed.linearisation.plant,
            actual=case.actual.linearisation.plant,
            controller=case.controller,
            prediction=case.prediction,
            simulation=simulation,
            scene=make_scene(case.model, simulation, run.study.magnification, select_frames(simulation.t))
            if run.on_engine
            else None,
            provenance=provenance(run.path.parent),
            notices=tuple(str(notice) for notice in (*case.notices, *list_remarks(simulation))),
            measures=measure_own(run, simulation),
            sway=measure_pressure(case, simulation, found["statistics"].start) if "statistics" in found else {},
            **found,
        )


def _beside(case: Case, plant: PlantKind, simulation: Simulation, report: Callable[[float], None]) -> dict[str, Any]:
    """What the study adds to a run that has a prediction."""
    from icmj.case.case import expect_rule, simulate
    from icmj.controller.controller import continuous_limit
    from icmj.experiments.amplitude_law import measure_law
    from icmj.experiments.growth import measure_growth

    study, found = case.run.study, dict[str, Any]()
    continuous = simulate(
        case,
        plant,
        trigger=continuous_limit(expect_rule(case, "a study"), case.settings.share_interval),
        duration=_continuous_duration(case, simulation),
        progress=lambda done: report(0.5 + 0.1 * done),
    )
    found["continuous"] = at_multiples(continuous, case.settings.record_interval)
    if simulation.outcome.kind not in ("interrupted", "stalled"):
        found["growth"] = measure_growth(case, plant, study.growth_points)
        report(0.75)
        if plant == "linear":
            found["attractors"] = _attractors(case, lambda done: report(0.75 + 0.15 * done))
        else:
            found["law"] = measure_law(case, study.law_q_t)
    return found


def at_multiples(simulation: Simulation, interval: float) -> Simulation:
    """The rows of a run at the multiples of an interval [s], and its last row, without its events.

    With a delay, continuous control is a clock that ticks every few milliseconds, whose rows and states would be
    half of a log.
    """
    import numpy as np

    from icmj.base.array import list_multiples
    from icmj.series.interpolation import NEAR

    t, none, run = simulation.t, slice(0, 0), simulation
    due = np.append(np.searchsorted(t, list_multiples(interval, float(t[-1])) - NEAR), len(t) - 1)
    rows = np.unique(np.minimum(due, len(t) - 1))
    thin: dict[str, Any] = {name: getattr(run, name)[rows] for name in ("t", "x", "y", "u", "x_o", "x_h", "E")}
    # what a run without them leaves empty
    for name in ("qpos", "applied", "pushed", "mode"):
        thin[name] = getattr(run, name)[rows if len(getattr(run, name)) else none]
    if (ground := run.pressure) is not None:
        here = {name: getattr(ground, name)[rows] for name in ("t", "centre", "load")}
        after = {name: getattr(ground, name)[none] for name in ("t_after", "centre_after", "load_after")}
        thin["pressure"] = replace(ground, **here | after)
    events = type(run.events)(*(getattr(run.events, each.name)[none] for each in fields(run.events)))
    return replace(run, **thin, events=events)


def _continuous_duration(case: Case, simulation: Simulation) -> float | None:
    """The duration of the run under continuous control [s]; ``None`` for that of the run file."""
    if simulation.outcome.kind == "interrupted":
        return min(max(simulation.outcome.t, 1e-3 * case.settings.duration), AFTER_INTERRUPT)
    return min(case.settings.duration, AFTER_INTERRUPT) if simulation.outcome.kind == "stalled" else None


def _attractors(case: Case, progress: Callable[[float], None]) -> tuple[Attractor, ...]:
    if (starts := case.run.study.attractor_starts) == 0:
        return ()
    try:
        return find_attractors(case, starts, lambda count: progress(count / starts))
    except SimulationError:  # the run stays at zero, which is no scale to draw starts from
        return ()


def find_attractors(case: Case, starts: int, progress: Callable[[int], None] | None = None) -> tuple[Attractor, ...]:
    """The motions of a case's linear plant from as many random starts (:func:`icmj.experiments.attractors`)."""
    from icmj.case.case import expect_rule
    from icmj.case.plants import linear_plant
    from icmj.experiments.coexisting_motions import attractors

    plant, rule = linear_plant(case.actual, case.settings), expect_rule(case, "attractors")
    seed = case.run.study.seed
    return attractors(plant, rule, case.settings, starts=starts, seed=seed, match="position", progress=progress)


def admit(case: Case, plant: PlantKind, longest: float | None, *, study: bool = False) -> float:
    """See, before anything is written, that a run can start and is not longer than ``longest`` [s]; its estimate [s].

    ``study`` as for :func:`run_case`.

    Raises:
        IcmjError: if it cannot start, or is longer.
    """
    from icmj.study.estimate import estimate, refuse_long, startable

    with prefix_errors(case.run.path):
        startable(case, plant)
        seconds = estimate(case, plant, study=study)
    refuse_long(case, plant, seconds, longest, study=study)
    return seconds


def check(run: RunFile, longest: float | None = None, progress: Tell | None = None) -> list[float]:
    """Prepare a case and throw it away: bad input, and work without end, show before anything is written.

    Returns:
        The estimated time of each of its runs [s].
    """
    from icmj.case.case import prepare

    case = prepare(run)
    return [admit(case, plant, longest, study=True) for plant in plants_of(run)]


def log_case(run: RunFile, plant: PlantKind, folder: Path, progress: Tell | None = None) -> Path:
    """Run one case on one plant and write its log ``<case>.<plant>.rrd`` into ``folder``."""
    from icmj.log.writer import write_log

    log = folder / f"{run.case.name}.{plant}.rrd"
    write_log(run_case(run, plant, progress, study=True), log)
    return log


def open_folder(folder: Path, *names: str) -> None:
    """Have a folder to write files of these names into, cleared of what runs left that were ended in the middle.

    Raises:
        LogError: if they cannot be written there.
    """
    with explain_refusal(LogError, f"{folder}: cannot be written to", "; choose another --out"):
        try:
            make_ready(folder, *names)
        except FileExistsError as error:
            raise LogError(f"{error.filename}: cannot be written to ({error.strerror})") from error


def run_study(
    runs: Sequence[RunFile],
    out: Path,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
    longest: float | None = None,
) -> Outputs:
    """Run every case on its plants in ``jobs`` processes, then build the report and the summary from the logs.

    Args:
        runs: the cases.
        out: folder of the outputs; created if it does not exist.
        jobs: number of processes; if ``None``, the number of cores.
        progress: called repeatedly with a label and the completed fraction of the whole, 0–1.
        longest: longest time for one case on one plant; a case that is estimated to take longer is refused [s];
            ``None`` for no limit.

    Raises:
        IcmjError: the first error of any case. All inputs are checked before the first log is written.
    """
    if not runs:
        raise RunFileError("no run file given")
    tell = progress or (lambda label, done: None)
    cases = [(run, plant) for run in runs for plant in plants_of(run)]
    jobs = processes(jobs, len(cases))
    checks = [Task(f"{run.path}", check, (run, longest)) for run in runs]
    work = [Task(f"{run.case.name} ({plant})", log_case, (run, plant, out)) for run, plant in _in_turn(cases)]
    logs = tuple(out / f"{run.case.name}.{plant}.rrd" for run, plant in cases)
    checked, done = [0.0] * len(runs), [0.0] * len(work)  # in any order: processes overtake each other
    estimates: dict[str, list[float]] = {}
    try:
        with Workers(jobs) as workers:
            for message in workers.run(checks):
                checked[message.index] = message.done
                if message.value is not None:
                    estimates[runs[message.index].case.name] = message.value
                tell(f"checking {runs[message.index].case.name}", _CHECKS * sum(checked) / len(runs))
            open_folder(out, *(log.name for log in logs), "report.html", "summary.json")
            of_run = {
                (run.case.name, plant): _LEAST[plant] + seconds
                for run in runs
                for plant, seconds in zip(plants_of(run), estimates[run.case.name], strict=True)
            }
            weights = [of_run[task.arguments[0].case.name, task.arguments[1]] for task in work]
            page_weight = _PAGE * len(runs)
            share = (1 - _CHECKS) / (sum(weights) + page_weight)
            for message in workers.run(work):
                done[message.index] = message.done
                finished = sum(part * weight for part, weight in zip(done, weights, strict=True))
                tell(work[message.index].name, _CHECKS + share * finished)
            page = report(
                logs,
                out / "report.html",
                summary=out / "summary.json",
                workers=workers,
                progress=lambda part: tell("report", 1 - share * page_weight * (1 - part)),
            )
    finally:
        # what the workers had under way when they were ended
        clear_leftovers(out)
    tell("done", 1.0)
    return Outputs(logs, out / "report.html", out / "summary.json", page)


def _in_turn(cases: Sequence[tuple[RunFile, PlantKind]]) -> list[tuple[RunFile, PlantKind]]:
    """One of the engine, one on the linear plant, the engine's others, all other linear ones.

    The first time, the loop of each plant takes seconds to compile: two processes do so side by side, and the one that
    is done first has enough to do that does not wait for the other. The shortest runs come last, so that no process is
    left alone with a long one.
    """
    engine = [case for case in cases if case[1] == "mujoco"]
    linear = [case for case in cases if case[1] != "mujoco"]
    return [*engine[:1], *linear[:1], *engine[1:], *linear[1:]]
