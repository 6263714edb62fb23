"""The cost of a sweep, estimated from a few of its points."""

from __future__ import annotations

from dataclasses import dataclass

from icmj.study.chunk import compute
from icmj.study.plan import Plan


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
