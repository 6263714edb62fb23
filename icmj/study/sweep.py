"""The sweep: unfinished chunks are computed by the available processes and stored as they are finished."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pyarrow as pa
import pyarrow.parquet as pq

from icmj.case.case import Case, PlantKind, expect_measures, measure_own, prepare, simulate
from icmj.case.quantity import rule_unit
from icmj.errors import IcmjError, SweepError
from icmj.runfile.sweep_tables import SweepFile, load_sweep
from icmj.study.chunk import ChunkResult, compute, parquet, report_death
from icmj.study.plan import Plan
from icmj.study.sweep_folder import read_table, resume_sweep
from icmj.work.workers import Crew
from icmj.work.workers import crew as _crew

_SECONDS = ("delay", "delta_min", "sampling_delay", "time_constant", "duration")  # keys in seconds


def try_plan(plan: Plan) -> Plan:
    """The plan, with the names of outputs and of own measures, once one of a few points could be prepared.

    Raises:
        SweepError: if none could; it says why the first could not.
    """
    first: IcmjError | None = None
    for index in plan.tried():
        try:
            run = plan.run(plan.points.at(index))
            case = prepare(run)
            measures, outputs = _measures(case, plan.file.ask.motion), tuple(case.assumed.linearisation.plant.outputs)
            return replace(plan, outputs=outputs, measures=measures, units=_units(case, plan))
        except IcmjError as error:
            first = first or error
    raise SweepError(f"{plan.file.path}: none of a few points that were tried can be computed ({first})")


def _units(case: Case, plan: Plan) -> dict[str, str]:
    """Units of what varies and of the outputs, where they are known."""
    plant = case.actual.linearisation.plant
    states = dict(zip(plant.states, plant.state_units, strict=False))
    found = dict(zip(plant.outputs, plant.output_units, strict=False))
    for name, vary in zip(plan.points.names, plan.file.vary, strict=True):
        key = vary.fields[0] if vary.fields else ""
        where, _, last = key.rpartition(".")
        if where in ("simulation.initial", "simulation.observer"):
            found[name] = states.get(last, "")
        elif key == "controller.q_t":
            found[name] = rule_unit(case.assumed.linearisation.plant, case.controller)
        elif last in _SECONDS:
            found[name] = "s"
    return {name: unit for name, unit in found.items() if unit}


def _measures(case: Case, plants: Sequence[PlantKind]) -> tuple[str, ...]:
    """Names of the numbers that the user's own measures return of a run."""
    if not case.run.study.measures or not plants:
        return ()
    expect_measures(case.run)
    run = simulate(case, plants[0])
    return tuple(measure_own(case.run, run))


@dataclass(frozen=True)
class Progress:
    """Progress of a sweep.

    Attributes:
        points: number of points of the sweep.
        done: number of points that are finished.
        failed: number of points that failed in this call.
        rate: points computed per second so far; 0 at the start.
    """

    points: int
    done: int
    failed: int
    rate: float

    @property
    def left(self) -> float:
        """Remaining time at this rate [s]; infinite at the start."""
        return (self.points - self.done) / self.rate if self.rate > 0 else float("inf")


Told = Callable[[Progress], None]


def sweep(
    file: SweepFile | Path | str,
    out: Path | str | None = None,
    *,
    jobs: int | None = None,
    dask: str | None = None,
    progress: Told | None = None,
    allow_code: bool = False,
) -> pa.Table:
    """Compute a sweep, or its unfinished part, and return its table.

    Args:
        file: the sweep file, or its path.
        out: folder of the dataset; a sweep that was begun there is resumed. If ``None``, a temporary folder is used.
        jobs: number of local processes; by default the number of cores.
        dask: address of a Dask scheduler, whose workers are used instead.
        progress: called after each chunk.
        allow_code: whether Python code that the run file names may be run, if ``file`` is a path.

    Returns:
        One row for each point, in their order (docs/sweeps.md describes the columns).

    Raises:
        RunFileError: if the sweep file or the run file does not validate.
        SweepError: if the sweep cannot start, the folder is in use, or no process survives.
    """
    plan = make_plan(file, allow_code=allow_code)
    with nullcontext(out) if out is not None else TemporaryDirectory() as folder:
        carry_out(plan, Path(folder), jobs=jobs, dask=dask, progress=progress)
        return read_table(folder)


def make_plan(file: SweepFile | Path | str, *, allow_code: bool = False) -> Plan:
    """The plan of a sweep, checked and tried.

    Raises:
        RunFileError, SweepError: as :func:`sweep`.
    """
    return try_plan(Plan.of(file if isinstance(file, SweepFile) else load_sweep(file, allow_code=allow_code)))


def carry_out(
    plan: Plan, out: Path, *, jobs: int | None = None, dask: str | None = None, progress: Told | None = None
) -> Progress:
    """Compute the unfinished chunks into ``out``; memory does not grow with the number of points.

    Raises:
        SweepError: as :func:`sweep`.
    """
    with _crew(compute, jobs, dask) as crew, resume_sweep(out, plan) as (dataset, finished):
        tally = _Tally(plan, finished, progress)
        lost: list[int] = []
        for points, computed, _ in crew.compute(plan, map(plan.range, tally.missing())):
            chunk = points.start // plan.chunk
            if computed is None:
                lost.append(chunk)
                if len(lost) == 3 and not tally.computed:
                    _see_one_survive(plan, crew)
            else:
                dataset.write(chunk, computed)
                tally.add(chunk, computed)
        for chunk in lost:
            computed = _retry(plan, chunk, crew)
            dataset.write(chunk, computed)
            tally.add(chunk, computed)
        return tally.progress


def _see_one_survive(plan: Plan, crew: Crew) -> None:
    """Check that an idle process survives, since the machine itself may be killing processes.

    Raises:
        SweepError: if it cannot.
    """
    for _, computed, why in crew.compute(plan, iter([range(0)])):
        if computed is None:
            raise SweepError(f"{plan.file.path}: processes die even without a point to compute ({why})")


def _retry(plan: Plan, chunk: int, crew: Crew) -> ChunkResult:
    """Repeat a chunk whose process died, then its points one by one; a point that dies gets a row that says so."""
    ((_, whole, _),) = crew.compute(plan, iter([plan.range(chunk)]))
    if whole is not None:
        return whole
    parts: dict[int, pa.Table] = {}
    seconds = simulating = 0.0
    failed = 0
    single = (range(i, i + 1) for i in plan.range(chunk))
    for points, computed, why in crew.compute(plan, single):
        if computed is None:
            parts[points.start] = report_death(plan, points.start, why)
            failed += 1
        else:
            parts[points.start] = pq.read_table(pa.BufferReader(computed.content))
            seconds, simulating = seconds + computed.seconds, simulating + computed.simulating
            failed += computed.failed
    table = pa.concat_tables([parts[i] for i in sorted(parts)]).combine_chunks()
    return ChunkResult(parquet(table), len(table), failed, seconds, simulating)


class _Tally:
    """Finished chunks, and the rate of progress."""

    def __init__(self, plan: Plan, finished: set[int], told: Told | None) -> None:
        self._plan, self._finished, self._told = plan, finished, told
        self._begin, self.computed, self._failed = time.monotonic(), 0, 0
        self._done = sum(len(plan.range(chunk)) for chunk in finished)

    def missing(self) -> Iterator[int]:
        """Chunks to compute, in order."""
        return (chunk for chunk in range(self._plan.chunks) if chunk not in self._finished)

    def add(self, chunk: int, computed: ChunkResult) -> None:
        """Count one more finished chunk."""
        self.computed += computed.rows
        self._done += computed.rows
        self._failed += computed.failed
        if self._told is not None:
            self._told(self.progress)

    @property
    def progress(self) -> Progress:
        """The present progress."""
        took = time.monotonic() - self._begin
        return Progress(len(self._plan), self._done, self._failed, self.computed / took if took > 0 else 0.0)
