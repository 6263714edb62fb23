"""A chunk of a sweep: a row of results for each of its points, whatever became of them.

A point that failed, or whose controller has no prediction, has a row, too; values that are missing are empty.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.array import Array, is_between
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.numbers import Fact, Kind, collect_facts
from icmj.base.text import one_line
from icmj.case.case import (
    Case,
    PlantKind,
    Theory,
    expect_theory,
    measure_own,
    mode_roots,
    prepare,
    simulate,
)
from icmj.case.comparison import RUN, Ran, finite
from icmj.cycle.cycle import Cycle
from icmj.errors import AnalysisError, CycleError, IcmjError, beyond_memory
from icmj.experiments.many import LastCase
from icmj.experiments.switching_rounds import Rounds, rounds_of
from icmj.measurement.measurement import measure
from icmj.measurement.statistics import statistics
from icmj.runfile.schema import RunFile
from icmj.simulation.simulation import Simulation
from icmj.study.plan import Plan, Value
from icmj.study.study import find_attractors
from icmj.theory.prediction import PREDICTION, Prediction


@dataclass(frozen=True, eq=False)
class CycleSearch:
    """A cycle that was sought, or why there is none, and Δ_crit where a cycle is predicted [s]."""

    cycle: Cycle | None
    words: str
    delta_crit: float | None


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """A run with its rounds, and the outputs of its second half, shape (N, n_y)."""

    run: Simulation
    rounds: Rounds
    late: Array


CYCLE = (
    Fact("found", "found", "",
         "whether Newton found a cycle from the prediction or, where there is none, from the run",
         lambda of: of.cycle is not None, "truth"),
    Fact("words", "words", "", "why not", attrgetter("words"), "text"),
    Fact("interval", "open-loop interval", "s", "mean open-loop interval of the exact cycle",
         attrgetter("cycle.interval")),
    Fact("error", "error of the interval", "", "its relative departure from Δ_crit, where a cycle is predicted",
         lambda of: of.cycle.interval / of.delta_crit - 1 if of.delta_crit else None),
    Fact("period", "period", "s", "period of the exact cycle", attrgetter("cycle.period")),
    Fact("p", "events in a period", "", "events in it", attrgetter("cycle.events"), "whole"),
    Fact("mirrored", "mirrored", "", "whether its second half is the first with opposite sign",
         attrgetter("cycle.mirrored"), "truth"),
    Fact("attracting", "attracting", "",
         "whether every multiplier that is not ±1 by construction is inside the unit circle",
         attrgetter("cycle.attracting"), "truth"),
    Fact("multiplier", "largest multiplier", "", "magnitude of the largest multiplier",
         lambda of: np.abs(of.cycle.isolated).max(initial=0.0)),
    Fact("peak", "peak of each output", "", "largest magnitude of each output over it",
         attrgetter("cycle.y_peak"), "outputs"),
)  # fmt: skip
WITHOUT_PREDICTION = (
    Fact("outcome", "outcome", "", "completed, fell, diverged, stalled", attrgetter("run.outcome.kind"), "text"),
    Fact("end", "end", "s", "when the run ended", attrgetter("run.outcome.t")),
    Fact("switches", "switches", "", "switches in the run", lambda of: len(of.run.events), "count"),
    Fact("growth", "growth", "1/s",
         "rate at which the size of the motion changes, over its last rounds or its second half",
         attrgetter("rounds.growth")),
    Fact("factor", "factor", "", "size of a round over that of the one before; empty without rounds",
         attrgetter("rounds.factor")),
    Fact("period", "period", "s", "period of a round; empty without rounds", attrgetter("rounds.period")),
    Fact("peak", "peak of each output", "", "largest magnitude of each output in the second half of the run",
         lambda of: np.abs(of.late).max(axis=0), "outputs"),
    Fact("rms", "RMS of each output", "", "standard deviation of each output in the second half of the run",
         lambda of: of.late.std(axis=0), "outputs"),
)  # fmt: skip


TYPES = {"number": pa.float64(), "truth": pa.bool_(), "text": pa.string()}
KINDS: dict[Kind, pa.DataType] = {
    "number": pa.float64(), "eigenvalue": pa.float64(), "outputs": pa.float64(), "whole": pa.int32(),
    "count": pa.int64(), "truth": pa.bool_(), "text": pa.string(),
}  # fmt: skip
# of a controller without an event rule, which has no critical interval
ROOT = {
    "root_real": (
        pa.float64(),
        "real part of the rightmost characteristic root of the loop with all feedback on [1/s]",
    ),
    "root_imag": (pa.float64(), "its imaginary part, not negative [rad/s]"),
}
ORBITS = {
    "predicted_orbit_delta": (pa.list_(pa.float64()), "open-loop interval of each predicted orbit, rising [s]"),
    "predicted_orbit_eigenvalue": (pa.list_(pa.float64()), "eigenvalue there, +1 or −1"),
    "predicted_orbit_verdict": (pa.list_(pa.string()), "verdict on each orbit"),
    "predicted_orbit_multiplier": (pa.list_(pa.float64()), "magnitude of the largest multiplier of each orbit"),
}
GAPS = {"predicted_unresolved": (pa.bool_(), "whether crossings may be missing, because rounding hides them")}
OWN = (pa.float64(), "a number of a measure of the user's own")
ATTRACTORS = {
    "attractors": (pa.int32(), "motions found from random starts of the linear plant"),
    "attractor_kind": (pa.list_(pa.string()), "what each is, the most frequent first"),
    "attractor_p": (pa.list_(pa.int32()), "events in its period"),
    "attractor_interval": (pa.list_(pa.float64()), "its mean open-loop interval [s]"),
    "attractor_share": (pa.list_(pa.float64()), "share of the starts that led there"),
}


def meanings(plan: Plan) -> dict[str, tuple[pa.DataType, str]]:
    """All columns of a plan by name: their type, and what they mean."""
    ask, noisy = plan.file.ask, plan.file.base.resolve().simulation.settings().noisy
    varies = zip(plan.points.names, plan.points.kinds, strict=True)
    return columns(
        varies, plan.outputs, motion=ask.motion, cycle=ask.cycle, noisy=noisy, attractors=bool(ask.attractors),
        predicted=plan.file.base.has_events, measures=plan.measures,
    )  # fmt: skip


def columns(
    varies: Iterable[tuple[str, str]],
    outputs: Sequence[str],
    *,
    motion: Sequence[str],
    cycle: Sequence[str],
    noisy: bool,
    attractors: bool,
    predicted: bool = True,
    orbits: bool = True,
    gaps: bool = True,
    measures: Sequence[str] = (),
) -> dict[str, tuple[pa.DataType, str]]:
    """All columns by name: of what varies (name and kind), of outputs, of plants asked for a motion or a cycle.

    ``predicted`` says whether the controller has an event rule, and with it a prediction; ``orbits`` and ``gaps``,
    whether all its orbits are told, and whether some may be missing, which older sweeps do not; ``measures`` are names
    of the user's own numbers.
    """
    measured = own(dict.fromkeys(measures, OWN))
    found: dict[str, tuple[pa.DataType, str]] = {"point": (pa.int64(), "index of the point")}
    found |= {name: (TYPES[kind], "what varies") for name, kind in varies}
    found["status"] = (pa.string(), "ok, failed, or died with its process")
    found["words"] = (pa.string(), "why it failed; empty where it did not")
    told = (ORBITS if orbits else {}) | (GAPS if gaps else {})
    found |= _describe("predicted", PREDICTION, outputs) | told if predicted else ROOT
    for plant in motion:
        there = {"", plant, "noise" if noisy else ""}
        facts = [fact for fact in RUN if fact.only in there] if predicted else WITHOUT_PREDICTION
        found |= _describe(plant, facts, outputs) | {f"{plant}_{name}": column for name, column in measured.items()}
    for plant in cycle:
        found |= _describe(f"{plant}_cycle", CYCLE, outputs)
    return found | (ATTRACTORS if attractors else {})


def row_of(what: str, facts: Iterable[Fact], thing: Any, outputs: Sequence[str]) -> dict[str, Any]:
    """The values of facts by column, after what they are of; of an eigenvalue on the unit circle, its sign."""
    return {
        f"{what}_{name}": float(np.sign(value.real)) if isinstance(value, complex) else value
        for name, value in collect_facts(facts, thing, "column", outputs).items()
    }


def _describe(what: str, facts: Iterable[Fact], outputs: Sequence[str]) -> dict[str, tuple[pa.DataType, str]]:
    """The columns of facts, after what they are of."""
    found: dict[str, tuple[pa.DataType, str]] = {}
    for fact in facts:
        key, unit = fact.key("column"), "its unit" if fact.kind == "outputs" else fact.unit
        named = [f"{key}_{output}" for output in outputs] if fact.kind == "outputs" else [key]
        meaning = f"{fact.meaning} [{unit}]" if unit else fact.meaning
        found |= {f"{what}_{name}": (KINDS[fact.kind], meaning) for name in named if key}
    return found


def own(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """What is told by the user's own measures, by column."""
    return {f"measure_{name}": value for name, value in numbers.items()}


def schema(plan: Plan) -> pa.Schema:
    """Names and types of all columns, and the facts of the plan as metadata."""
    return pa.schema([(name, kind) for name, (kind, _) in meanings(plan).items()], metadata=dict(plan.facts))


def table(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Rows as a table with all columns; what a row does not have is empty."""
    fields = schema(plan)
    arrays = [pa.array([row.get(field.name) for row in rows], field.type) for field in fields]
    return pa.Table.from_arrays(arrays, schema=fields)


def begin_row(plan: Plan, index: int, values: tuple[Value, ...]) -> dict[str, Any]:
    """The start of a row: index of the point, and its varied values."""
    row: dict[str, Any] = {"point": index, "status": "ok", "words": ""}
    for name, kind, value in zip(plan.points.names, plan.points.kinds, values, strict=True):
        if kind == "number":
            row[name] = float(value)
        else:
            row[name] = json.dumps(value) if kind == "text" and not isinstance(value, str) else value
    return row


Tell = Callable[[float], None]


@dataclass(frozen=True)
class ChunkResult:
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


def compute(plan: Plan, indices: range, progress: Tell | None = None) -> ChunkResult:
    """The rows of some points, computed with one thread of linear algebra, so that the load changes no bit."""
    plan.expect_same_code()
    bench, begin = _Bench(), time.process_time()
    rows = []
    with limit_to_one_thread():
        for index, values in zip(indices, plan.points.block(indices.start, indices.stop), strict=True):
            rows.append(_row(plan, index, values, bench))
            if progress is not None:
                progress(len(rows) / len(indices))
    failed = sum(row["status"] != "ok" for row in rows)
    return ChunkResult(parquet(table(plan, rows)), len(rows), failed, time.process_time() - begin, bench.simulating)


def report_death(plan: Plan, index: int, why: str) -> pa.Table:
    """The row of a point whose computation ended its process."""
    words = f"its process died ({why}), twice: out of memory, or MuJoCo ended it"
    return table(plan, [begin_row(plan, index, plan.points.at(index)) | {"status": "died", "words": words}])


def parquet(table: pa.Table) -> bytes:
    """A table as a whole Parquet file."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    return bytes(sink.getvalue())


def _row(plan: Plan, index: int, values: tuple[Any, ...], bench: _Bench) -> dict[str, Any]:
    row = begin_row(plan, index, values)
    try:
        if not plan.file.base.has_events:
            return row | _row_without_prediction(prepare(plan.run(values)), plan.file.ask.motion)
        case = _case(plan, plan.run(values), bench.last)
        theory = expect_theory(case, "the prediction")
        row |= row_of("predicted", PREDICTION, theory.prediction, _outputs(case)) | _orbits(theory.prediction)
        for plant in plan.file.ask.motion:
            begin = time.process_time()
            row |= _motion(case, theory, plant)
            bench.simulating += time.process_time() - begin
        for plant in plan.file.ask.cycle:
            row |= _cycle(case, theory, plant)
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
    return last.get(run, getattr(base, "q_t", None) if run.intermittent.rule == base.rule else None)


def _motion(case: Case, theory: Theory, plant: PlantKind) -> dict[str, Any]:
    run = simulate(case, plant)
    motion = measure(run, T_hat=theory.system.T_hat)
    assumed, actual = case.assumed.linearisation.plant, case.actual.linearisation.plant
    ran = Ran(assumed, actual, theory.prediction, run, motion, statistics(run) if run.noisy else None)
    there = {"", plant, "noise" if run.noisy else ""}
    row = row_of(plant, [fact for fact in RUN if fact.only in there], ran, _outputs(case))
    return row | {f"{plant}_{name}": value for name, value in own(measure_own(case.run, run)).items()}


def _cycle(case: Case, theory: Theory, plant: PlantKind) -> dict[str, Any]:
    from icmj.cycle.cycle import find_cycle

    what = f"{plant}_cycle"
    try:
        found = find_cycle(case, plant)
    except CycleError as error:
        return row_of(what, CYCLE[:2], CycleSearch(None, one_line(error, 300), None), ())
    crit = theory.prediction.delta_crit if theory.prediction.cycle else None
    return row_of(what, CYCLE, CycleSearch(found, "", crit), _outputs(case))


def _orbits(prediction: Prediction) -> dict[str, Any]:
    return {
        "predicted_orbit_delta": [one.crossing.delta for one in prediction.orbits],
        "predicted_orbit_eigenvalue": [float(np.sign(one.crossing.eigenvalue.real)) for one in prediction.orbits],
        "predicted_orbit_verdict": [one.verdict for one in prediction.orbits],
        "predicted_orbit_multiplier": [finite(one.multiplier) for one in prediction.orbits],
        "predicted_unresolved": bool(prediction.unresolved),
    }


def _attractors(plan: Plan, case: Case) -> dict[str, Any]:
    found = find_attractors(case, plan.file.ask.attractors)
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
        moved = MeasuredRun(motion, rounds_of(motion), motion.y[is_between(motion.t, motion.t[-1] / 2)])
        row |= row_of(plant, WITHOUT_PREDICTION, moved, _outputs(case))
        row |= {f"{plant}_{name}": value for name, value in own(measure_own(case.run, motion)).items()}
    return row
