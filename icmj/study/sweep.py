"""The sweep: unfinished chunks are computed by the available processes and stored as they are finished.

The folder of a sweep: one complete Parquet file for each chunk, and a description (:mod:`icmj.work.folder`).

    OUT/sweep.json          the description: texts, fingerprint, versions, provenance
    OUT/points/*.parquet    the rows, one file for each finished chunk
    OUT/timing.csv          the time that each chunk took

Rows and files contain neither time nor place, so that they are the same bit for bit on every machine and at every time.
The folder may come from somebody else: what it holds is checked before it is used.
"""

from __future__ import annotations

import os
import re
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from icmj.base.files import regular
from icmj.base.parquet import read_parquet
from icmj.base.text import one_line
from icmj.case.case import Case, PlantKind, expect_measures, measure_own, prepare, simulate
from icmj.case.quantity import rule_unit
from icmj.case.sweep_table import SweepTable
from icmj.errors import IcmjError, SweepError
from icmj.runfile.sweep_tables import Facts, SweepFile, load_sweep, parse_facts
from icmj.study.chunk import TYPES, ChunkResult, columns, compute, meanings, parquet, report_death, schema
from icmj.study.plan import Plan
from icmj.work.folder import Description, Folder, provenance, resume
from icmj.work.workers import Crew
from icmj.work.workers import crew as _crew

WHAT, POINTS, TIMING = "sweep", "points", "timing.csv"
_MOST_OF_ROW, _MOST_OF_CHUNK = 100e3, 500e6  # bytes of a row, and of one chunk, in its file and in memory
_CHUNK = re.compile(r"\d{8,10}")


class Dataset:
    """The folder of one sweep; its description is read and checked.

    Raises:
        SweepError: if it is no such folder.
    """

    def __init__(self, path: Path | str, folder: Folder | None = None) -> None:
        self._folder = folder or Folder(Path(path), SweepError)
        self.facts: Facts = self._folder.describe(WHAT, parse_facts)
        self.path = self._folder.path

    def files(self) -> dict[int, Path]:
        """The files of finished chunks by their number, in order.

        Raises:
            SweepError: if one has a name that none of them has.
        """
        found = {}
        for path in (self.path / POINTS).glob("*.parquet"):
            number = int(path.stem) if _CHUNK.fullmatch(path.stem) and path.stem.isascii() else -1
            if f"{number:08d}" != path.stem or number >= self.facts.chunks:
                raise SweepError(f"{one_line(path, 300)}: not a chunk of this sweep, by its name; remove it")
            found[number] = path
        return dict(sorted(found.items()))

    def chunks(self, only: Sequence[str] = (), schema: pa.Schema | None = None) -> Iterator[tuple[int, pa.Table]]:
        """The finished chunks, their number and rows, in order.

        Args:
            only: columns to read; all if there are none.
            schema: what the columns must be; those of the first chunk if ``None``.

        Raises:
            SweepError: if one cannot be read, or belongs to another sweep.
        """
        known = schema

        def parse(content: bytes) -> pa.Table:
            def check(found: pa.Schema, count: int) -> None:
                nonlocal known
                self._check_columns(found, known)
                if count != len(rows):
                    raise ValueError(f"{count} rows, expected {len(rows)}")
                known = found

            table = read_parquet(content, self.facts.chunk, most, list(only) or None, check)
            _check_values(table, rows, self.facts)
            return table

        files, most = self.files(), min(_MOST_OF_CHUNK, _MOST_OF_ROW * (self.facts.chunk + 100))
        self._folder.expect_readable(files.values())
        for chunk, path in files.items():
            rows = self.facts.rows(chunk)
            yield chunk, self._folder.read(path, most, parse)

    def write(self, chunk: int, computed: ChunkResult) -> None:
        """Write one chunk, and how long it took; this is not essential, and omitted if it cannot be written.

        Raises:
            SweepError: if the chunk cannot be written.
        """
        with self._folder.seal(self.path / POINTS / f"{chunk:08d}.parquet") as part:
            part.write_bytes(computed.content)
        line = f"{chunk},{computed.rows},{computed.failed},{computed.seconds:.4f},{computed.simulating:.4f}\n"
        with suppress(OSError):
            handle = regular(self.path / TIMING, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            with os.fdopen(handle, "a", encoding="utf-8") as file:
                file.write(line)

    def _check_columns(self, found: pa.Schema, known: pa.Schema | None) -> None:
        facts = self.facts
        if (found.metadata or {}).get(b"icmj.fingerprint") != facts.fingerprint.encode():
            raise ValueError("of another sweep")
        if known is not None:
            if not found.equals(known):
                raise ValueError("with other columns")
            return
        names = found.names
        asked = {
            what: [plant for plant in ("linear", "mujoco") if f"{plant}_{mark}" in names]
            for what, mark in (("motion", "outcome"), ("cycle", "cycle_found"), ("noisy", "binding"))
        }
        expected = columns(
            [(name, "number") for name in facts.varies], facts.outputs, motion=asked["motion"], cycle=asked["cycle"],
            noisy=bool(asked["noisy"]), attractors="attractors" in names,
            predicted="root_real" not in names, orbits="predicted_orbit_delta" in names,
            gaps="predicted_unresolved" in names, measures=facts.measures,
        )  # fmt: skip
        if names != list(expected):
            raise ValueError("columns that a sweep does not have, or lacks")
        for field in found:
            types = TYPES.values() if field.name in facts.varies else [expected[field.name][0]]
            if field.type not in types:
                raise ValueError(f"column {field.name} of {field.type}")


@contextmanager
def resume_sweep(path: Path | str | None, plan: Plan) -> Iterator[tuple[Dataset, set[int]]]:
    """The folder of a sweep, new or resumed, and the numbers of the chunks that are finished.

    Raises:
        SweepError: as :func:`icmj.work.folder.resume`, or if a chunk cannot be read, or belongs to another sweep.
    """
    file, base = plan.file, plan.file.base
    more = {
        "name": file.sweep.name,
        "title": file.sweep.title or one_line(f"{base.case.title}, over {', '.join(plan.points.names)}", 200),
        "seed": plan.file.sweep.seed,
        "varies": list(plan.points.names),
        "fields": [vary.fields[0] if vary.fields else "" for vary in plan.file.vary],
        "outputs": list(plan.outputs),
        **({"code": dict(plan.code)} if plan.code else {}),
        "measures": list(plan.measures),
        "units": dict(plan.units),
        "columns": {name: meaning for name, (_, meaning) in meanings(plan).items()},
        "provenance": provenance(file.path.parent),
        "sweep": file.text,
        "run": base.text,
        "run_path": base.path.name,
    }
    mark = {"fingerprint": plan.fingerprint, "points": len(plan), "chunk": plan.chunk}
    of = Description(WHAT, POINTS, mark, "sweep file, run file, model or code", more, parse_facts)
    with resume(path, of, SweepError, beside=(TIMING,)) as folder:
        dataset = Dataset(folder.path, folder)
        yield dataset, {chunk for chunk, _ in dataset.chunks(["point", "status"], schema(plan))}


def read_sweep(folder: Path | str) -> SweepTable:
    """Read the finished part of a sweep, with the data that its figures need.

    Raises:
        SweepError: if the folder is not that of a sweep, no chunk is finished, or a file is damaged.
    """
    facts = Dataset(folder).facts
    varies = tuple(zip(facts.varies, facts.fields, strict=True))
    return SweepTable(facts.name, facts.title or facts.name, varies, facts.points, read_table(folder), facts.units)


def read_table(folder: Path | str) -> pa.Table:
    """All rows of a folder that are there, in order, as one table.

    Raises:
        SweepError: if there is none, or a file of it cannot be read.
    """
    tables = [table for _, table in Dataset(folder).chunks()]
    if not tables:
        raise SweepError(f"{folder}: no point is finished there")
    return pa.concat_tables(tables)


def statuses(folder: Path) -> Counter[str]:
    """Number of rows of each status, one file at a time.

    Raises:
        SweepError: as :func:`read_table`.
    """
    found: Counter[str] = Counter()
    for _, table in Dataset(folder).chunks(["point", "status"]):
        found.update(table["status"].to_pylist())
    return found


def _check_values(table: pa.Table, rows: range, facts: Facts) -> None:
    """Check the order and status of points, that varied values are finite, and that a cycle has an interval."""
    names = table.column_names
    if "point" in names and table["point"].to_pylist() != list(rows):
        raise ValueError("with other points")
    for name in ("status", "words"):
        if name in names and table[name].null_count:
            raise ValueError(f"without {name}")
    for name in facts.varies:
        if name in names and (
            table[name].null_count
            or (table[name].type == TYPES["number"] and not pc.all(pc.is_finite(table[name])).as_py())
        ):
            raise ValueError(f"column {name} has gaps")
    for plant in ("linear", "mujoco"):
        needed = [f"{plant}_{name}" for name in ("kind", "interval", "p")]
        if not set(needed) <= set(names):
            continue
        cycle = table.filter(pc.fill_null(pc.equal(table[needed[0]], "cycle"), False))
        interval = cycle[needed[1]].to_numpy(zero_copy_only=False)
        if cycle[needed[2]].null_count or not (np.isfinite(interval) & (interval > 0)).all():
            raise ValueError(f"a cycle without {plant}_interval")


@dataclass(frozen=True)
class SweepCost:
    """The estimated cost of a sweep, from a few of its points.

    Attributes:
        points, chunks: how many.
        seconds: processor time for all of it [s].
        size: of the dataset [bytes].
    """

    points: int
    chunks: int
    seconds: float
    size: float


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


def estimate(plan: Plan) -> SweepCost:
    """Estimate the cost of the sweep from a few points; the first is computed twice, because it loads libraries."""
    compute(plan, range(1))
    done = [compute(plan, range(index, index + 1)) for index in plan.tried()]
    few = compute(plan, range(min(plan.chunk, len(plan), 25)))
    empty = len(compute(plan, range(0)).content)
    seconds = sum(each.seconds for each in done) / len(done)
    # points of one chunk share plants where they can
    seconds = min(seconds, few.seconds / few.rows) if few.rows >= len(done) else seconds
    each = (len(few.content) - empty) / few.rows
    return SweepCost(len(plan), plan.chunks, seconds * len(plan), each * len(plan) + empty * plan.chunks)


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
