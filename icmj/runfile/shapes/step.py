"""A step: a change at an instant that lasts, of what acts on an input or a body, or of a set-point."""

from __future__ import annotations

from typing import Literal

from icmj.base.array import Array, Finite
from icmj.controller.setpoint import step
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import keys_of
from icmj.runfile.target import TargetTable
from icmj.simulation.sources import Step


@keys_of(Step)
class StepTable(PlaceTable):
    """A step on an input or a body: ``size`` [N m] from ``start`` [s] on."""

    kind: Literal["step"]
    size: Finite | None = None


class StepSetpoint(TargetTable):
    """A step of ``size`` at ``start`` [s], by default at the beginning of the run."""

    kind: Literal["step"]
    size: Finite
    """Size of the step [unit of the output]."""

    def terms(self, end: float) -> Array:
        return step(self.size, self.start)


DISTURBANCE, SETPOINT = StepTable, StepSetpoint
