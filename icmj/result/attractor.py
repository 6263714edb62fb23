"""One motion that starts lead to."""

from __future__ import annotations

from dataclasses import dataclass

from icmj.base.array import Array
from icmj.measurement.measurement import Measurement


@dataclass(frozen=True, eq=False)
class Attractor:
    """One motion that starts lead to.

    Attributes:
        measurement: what it is, from the first start that led there.
        states: x̄ at the events of its last period, shape (p, n + n̂); (0, n + n̂) without a cycle.
        count: starts that led there.
        share: part of all starts.
        x0, x_o0: the first such start, plant (n,) and observer state (n̂,).
    """

    measurement: Measurement
    states: Array
    count: int
    share: float
    x0: Array
    x_o0: Array
