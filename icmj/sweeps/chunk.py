"""Computation of one chunk of points: a row for each point, also for points that fail or whose
controller has no prediction.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.array import between
from icmj.base.environment import single_threaded
from icmj.base.text import one_line
from icmj.case.case import (
    Case,
    PlantKind,
    expect_prediction,
    measure_own,
    mode_roots,
    prepare,
    simulate,
)
from icmj.case.plants import linear_plant
from icmj.comparison.comparison import finite
from icmj.comparison.facts import RUN, Ran
from icmj.errors import AnalysisError, CycleError, IcmjError, beyond_memory
from icmj.experiments.attractors import attractors
from icmj.experiments.many import LastCase
from icmj.experiments.rounds import rounds_of
from icmj.measurement.measurement import measure
from icmj.measurement.statistics import statistics
from icmj.runfile.schema import RunFile
from icmj.sweeps import columns
from icmj.sweeps.facts import CYCLE, WITHOUT_PREDICTION, Moved, Sought
from icmj.sweeps.plan import Plan
from icmj.theory.facts import PREDICTION

if TYPE_CHECKING:
    from icmj.case.case import PredictedCase

Tell = Callable[[float], None]


@dataclass(frozen=True)
class Computed:
    """The results of some points.

    Attributes:
        content: a whole Parquet file of their rows.
        rows: how many.
        failed: how many of them failed.
        seconds: processor time that it took [s], and of that `simulating`.
    """

    content: bytes
    rows: int
    failed: int
    seconds: float
    simulating: float


@dataclass
class _Bench:
    """What the points of one chunk share: the last case, and the processor time of simulations [s]."""

    last: LastCase = field(default_factory=LastCase)
    simulating: float = 0.0


def compute(plan: Plan, indices: range, progress: Tell | None = None) -> Computed:
    """The rows of some points, computed with one thread of linear algebra, so that the load changes no bit."""
    plan.expect_same_code()
    bench, begin = _Bench(), time.process_time()
    rows = []
    with single_threaded():
        for index, values in zip(indices, plan.points.block(indices.start, indices.stop), strict=True):
            rows.append(_row(plan, index, values, bench))
            if progress is not None:
                progress(len(rows) / len(indices))
    failed = sum(row["status"] != "ok" for row in rows)
    return Computed(
        parquet(columns.table(plan, rows)), len(rows), failed, time.process_time() - begin, bench.simulating
    )


def died(plan: Plan, index: int, why: str) -> pa.Table:
    """The row of a point whose computation ended its process."""
    words = f"its process died ({why}), twice: out of memory, or MuJoCo ended it"
    return columns.table(plan, [columns.begun(plan, index, plan.points.at(index)) | {"status": "died", "words": words}])


def parquet(table: pa.Table) -> bytes:
    """A table as a whole Parquet file."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return bytes(sink.getvalue())


def _row(plan: Plan, index: int, values: tuple[Any, ...], bench: _Bench) -> dict[str, Any]:
    row = columns.begun(plan, index, values)
    try:
        if not plan.file.base.has_events:
            return row | _row_without_prediction(prepare(plan.run(values)), plan.file.ask.motion)
        case = expect_prediction(_case(plan, plan.run(values), bench.last), "the prediction")
        row |= columns.row_of("predicted", PREDICTION, case.prediction, _outputs(case))
        for plant in plan.file.ask.motion:
            begin = time.process_time()
            row |= _motion(case, plant)
            bench.simulating += time.process_time() - begin
        for plant in plan.file.ask.cycle:
            row |= _cycle(case, plant)
        if plan.file.ask.attractors:
            row |= _attractors(plan, case)
    except IcmjError as error:
        row |= {"status": "failed", "words": one_line(error, 500)}
    except Exception as error:  # a row that says so, not the end of a million others
        words = "out of memory" if beyond_memory(error) else one_line(f"{type(error).__name__}: {error}", 500)
        row |= {"status": "failed", "words": words}
    return row


def _case(plan: Plan, run: RunFile, last: LastCase) -> Case:
    """The case of a run file; where q_t varies, theory is asked at the base run's, and scaled.

    So it has the same bits whichever points were computed before it.
    """
    base = plan.file.base.intermittent
    return last.get(run, base.q_t if run.intermittent.rule == base.rule == "quadratic" else None)


def _motion(case: PredictedCase, plant: PlantKind) -> dict[str, Any]:
    run = simulate(case, plant)
    motion = measure(run, T_hat=case.system.T_hat)
    assumed, actual = case.assumed.linearisation.plant, case.actual.linearisation.plant
    ran = Ran(assumed, actual, case.prediction, run, motion, statistics(run) if run.noisy else None)
    there = {"", plant, "noise" if run.noisy else ""}
    row = columns.row_of(plant, [fact for fact in RUN if fact.only in there], ran, _outputs(case))
    return row | {f"{plant}_{name}": value for name, value in columns.own(measure_own(case.run, run)).items()}


def _cycle(case: PredictedCase, plant: PlantKind) -> dict[str, Any]:
    from icmj.cycle.cycle import find_cycle

    what = f"{plant}_cycle"
    try:
        found = find_cycle(case, plant)
    except CycleError as error:
        return columns.row_of(what, CYCLE[:2], Sought(None, one_line(error, 300), None), ())
    crit = case.prediction.delta_crit if case.prediction.cycle else None
    return columns.row_of(what, CYCLE, Sought(found, "", crit), _outputs(case))


def _attractors(plan: Plan, case: PredictedCase) -> dict[str, Any]:
    found = attractors(
        linear_plant(case.actual, case.settings),
        case.controller,
        case.settings,
        starts=plan.file.ask.attractors,
        match="position",
        seed=case.run.study.seed,
    )
    return {
        "attractors": len(found),
        "attractor_kind": [each.measurement.kind for each in found],
        "attractor_p": [each.measurement.p for each in found],
        "attractor_interval": [finite(each.measurement.interval) for each in found],
        "attractor_share": [each.share for each in found],
    }


def _outputs(case: Case) -> tuple[str, ...]:
    return case.assumed.linearisation.plant.outputs


def _row_without_prediction(case: Case, plants: Sequence[PlantKind]) -> dict[str, Any]:
    """The columns of one point, with the motion on each of ``plants``; a root that cannot be found is left out."""
    row: dict[str, Any] = {}
    try:
        root = next(iter(mode_roots(case, 1).values()))[0]
        row |= {"root_real": float(root.real), "root_imag": abs(float(root.imag))}
    except AnalysisError:  # it reads its outputs as they are, or its rates are out of proportion to its delay
        pass
    for plant in plants:
        motion = simulate(case, plant)
        moved = Moved(motion, rounds_of(motion), motion.y[between(motion.t, motion.t[-1] / 2)])
        row |= columns.row_of(plant, WITHOUT_PREDICTION, moved, _outputs(case))
        row |= {f"{plant}_{name}": value for name, value in columns.own(measure_own(case.run, motion)).items()}
    return row
