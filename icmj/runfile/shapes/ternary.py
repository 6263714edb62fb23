"""A pseudo-random ternary sequence of velocities −v, 0 and v, integrated; it repeats after 242 intervals."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from icmj.base.array import Array, Finite, Positive
from icmj.controller.setpoint import ternary
from icmj.errors import AnalysisError, SimulationError
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import TomlTable, keys_of
from icmj.runfile.target import MOST_INTERVALS, TargetTable
from icmj.simulation.sources import Sinusoids, Source
from icmj.simulation.ternary import make_ternary_lines


class SequenceTable(TomlTable):
    """A course that is a pseudo-random ternary sequence of velocities, integrated."""

    size: Finite
    """Peak-to-peak size of the sequence [unit of the signal]. A negative size gives the mirror image."""
    interval: Annotated[Positive, Field(ge=1e-3)] = 0.25
    """Duration of each velocity [s]."""


@keys_of(Sinusoids, without=("terms",))
class TernaryTable(SequenceTable, PlaceTable):
    """A pseudo-random ternary sequence of velocities −v, 0, v, integrated: the sum of its lines up to ``bandwidth``.

    It repeats after 242 intervals. As a sum of sinusoids it is smooth, like the motion of a platform.
    """

    kind: Literal["ternary"]
    bandwidth: Positive | None = None
    """Highest line [Hz] (default: half of 1 / interval)."""

    def source(self) -> Source:
        highest = 0.5 / self.interval if self.bandwidth is None else self.bandwidth
        terms = make_ternary_lines(self.size, self.interval, highest)
        if not len(terms) and abs(self.size) < np.finfo(float).tiny:
            raise SimulationError(f"ternary: nothing is left of a size of {self.size:g}; leave the disturbance out")
        if not len(terms):
            raise SimulationError(
                f"ternary: no line up to {highest:g} Hz; the first is at {1 / 242 / self.interval:g} Hz"
            )
        return self.make_source(Sinusoids, terms=tuple(map(tuple, terms.tolist())))


class TernarySetpoint(SequenceTable, TargetTable):
    """A pseudo-random ternary sequence of velocities −v, 0, v, integrated; it repeats after 242 intervals."""

    kind: Literal["ternary"]

    @property
    def ends_with_run(self) -> bool:
        return True

    def terms(self, end: float) -> Array:
        intervals = (end - self.start) / self.interval
        if intervals > MOST_INTERVALS:
            raise AnalysisError(
                f"a ternary set-point of {self.interval:g} s has {intervals:.3g} intervals in this run; expected at "
                f"most {MOST_INTERVALS}, lengthen its interval"
            )
        return ternary(self.size, self.interval, self.start, end)


DISTURBANCE, SETPOINT = TernaryTable, TernarySetpoint
