"""A ramp: from zero to a size over a time, and then constant."""

from __future__ import annotations

from typing import Literal

import numpy as np

from icmj.base.array import Array, Finite, NonNegative, Positive
from icmj.controller.setpoint import ramp
from icmj.errors import SimulationError
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import keys_of
from icmj.runfile.target import TargetTable
from icmj.simulation.sources import GRID, MOST_VALUES, Sampled, Source


@keys_of(Sampled, without=("values",))
class RampTable(PlaceTable):
    """A ramp from 0 at ``start`` [s] to ``size``, linear over ``duration`` [s], and then constant."""

    kind: Literal["ramp"]
    size: Finite | None = None
    """Value at the end of the ramp [unit of the disturbed signal]. For a body, a factor on force and torque (default:
    1)."""
    start: NonNegative = 0.0
    """Start [s], an integer multiple of ``interval``."""
    duration: Positive
    """Duration [s], an integer multiple of ``interval``."""
    interval: Positive = GRID
    """Distance between the points of the grid on which it starts and ends [s]."""

    def source(self) -> Source:
        """The source that it stands for."""
        first, last = self.start / self.interval, (self.start + self.duration) / self.interval
        if max(abs(first - round(first)), abs(last - round(last))) > 1e-6 or last > MOST_VALUES - 1:
            raise SimulationError(
                f"ramp: start {self.start:g} s and duration {self.duration:g} s must be integer multiples of its "
                f"interval, {self.interval:g} s, and at most {MOST_VALUES} of them"
            )
        share = np.clip((np.arange(round(last) + 1) - round(first)) / (round(last) - round(first)), 0.0, 1.0)
        return self.make_source(Sampled, values=tuple((self.full_size * share).tolist()), start=0.0)


class RampSetpoint(TargetTable):
    """A ramp from 0 at ``start`` [s] to ``size``, linear over ``duration`` [s], and then constant."""

    kind: Literal["ramp"]
    size: Finite
    """Value at the end of the ramp [unit of the output]."""
    duration: Positive
    """Duration [s]."""

    def terms(self, end: float) -> Array:
        return ramp(self.size, self.start, self.duration)


DISTURBANCE, SETPOINT = RampTable, RampSetpoint
