"""What a simulation did: the cycle it settled on, or that it grew, decayed, wandered or was too short to tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from icmj.linear_plant import Array

MotionKind = Literal["cycle", "quasi-periodic", "irregular", "growth", "decay", "homoclinic", "too short", "no events"]


@dataclass(frozen=True, eq=False)
class Measurement:
    """The motion at the end of a run, read from its events.

    Attributes:
        kind: what the motion is; ``homoclinic`` is an interval that keeps growing while the state decays.
        p: events per period (1, 2, ... 8), or ``None`` where there is no cycle. A mirrored cycle has p = 2.
        mirrored: whether the second half of the cycle is the first with opposite sign.
        interval: mean open-loop interval over the last period [s], or the last intervals' mean where there is no
            cycle; ``None`` without events.
        intervals: the intervals of the last period, shape (p,); empty where there is no cycle.
        period: time after which the state repeats [s], or ``None``.
        amplitude: peak magnitude of every output over the last period, shape (n_y,) (over the last ten events
            where there is no cycle).
        residual: relative closure error of the last period, |x̄_i − x̄_{i−p}| / |x̄_i|; NaN without a cycle.
        words: one sentence for people.
    """

    kind: MotionKind
    p: int | None
    mirrored: bool
    interval: float | None
    intervals: Array
    period: float | None
    amplitude: Array
    residual: float
    words: str
