"""A few points tried before a sweep starts: that it can, how long it will take and how much it will write."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from icmj.case.case import Case, PlantKind, prepare, simulate
from icmj.case.trial import Trial, measured_by, prepare_trial, simulate_trial
from icmj.errors import IcmjError, SweepError
from icmj.sweeps.chunk import compute
from icmj.sweeps.plan import Plan


@dataclass(frozen=True)
class Estimate:
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


def tried(plan: Plan) -> Plan:
    """The plan, with the names of outputs and of own measures, once one of a few points could be prepared.

    Raises:
        SweepError: if none could; it says why the first could not.
    """
    first: IcmjError | None = None
    for index in plan.tried():
        try:
            run = plan.run(plan.points.at(index))
            case = prepare_trial(run) if run.tries else prepare(run)
            told = _measures(case, plan.file.ask.motion)
            return replace(plan, outputs=tuple(case.assumed.linearisation.plant.outputs), measures=told)
        except IcmjError as error:
            first = first or error
    raise SweepError(f"{plan.file.path}: no point of a few that were tried can be computed: {first}")


def _measures(case: Case | Trial, plants: Sequence[PlantKind]) -> tuple[str, ...]:
    """Names of the numbers that the user's own measures return of a run."""
    if not case.run.study.measures or not plants:
        return ()
    run = simulate(case, plants[0]) if isinstance(case, Case) else simulate_trial(case, plants[0])
    return tuple(measured_by(case.run, run))


def estimate(plan: Plan) -> Estimate:
    """Estimate the cost of the sweep from a few points; the first is computed twice, because it loads libraries."""
    compute(plan, range(1))
    done = [compute(plan, range(index, index + 1)) for index in plan.tried()]
    few = compute(plan, range(min(plan.chunk, len(plan), 25)))
    empty = len(compute(plan, range(0)).content)
    seconds = sum(each.seconds for each in done) / len(done)
    # points of one chunk share plants where they can
    seconds = min(seconds, few.seconds / few.rows) if few.rows >= len(done) else seconds
    each = (len(few.content) - empty) / few.rows
    return Estimate(len(plan), plan.chunks, seconds * len(plan), each * len(plan) + empty * plan.chunks)
