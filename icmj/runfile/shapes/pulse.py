"""A pulse of a set-point: a step, and after a time its reversal."""

from __future__ import annotations

from typing import Literal

from icmj.base.array import Array, Finite, Positive
from icmj.controller.setpoint import pulse
from icmj.runfile.target import TargetTable


class PulseSetpoint(TargetTable):
    """A pulse of ``size`` from ``start`` [s] on, which ends after ``duration`` [s]."""

    kind: Literal["pulse"]
    size: Finite
    """Size of the pulse [unit of the output]."""
    duration: Positive
    """Duration [s]."""

    def terms(self, end: float) -> Array:
        return pulse(self.size, self.start, self.duration)


SETPOINT = PulseSetpoint
