"""Sinusoids given term by term, each in a window of its own; what a user's own code draws is stored so.

As a disturbance the terms are those of the signal, as a set-point those of its rate of change.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Len

from icmj.base.array import Array, Finite
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import LISTED, Line, keys_of
from icmj.runfile.target import MOST_INTERVALS, TargetTable
from icmj.simulation.sources import Sinusoids

Term = Annotated[tuple[Finite, Finite, Finite, Finite, Finite], LISTED]


@keys_of(Sinusoids)
class SinusoidsTable(PlaceTable):
    """A sum of sinusoids on one input or body, or on one output as the observer reads it.

    See :class:`icmj.simulation.sources.Sinusoids`. Noise from user code is also recorded in this form.
    """

    kind: Literal["sinusoids"]
    made_by: Line = ""
    """Code that drew the terms, as ``module:name``."""
    sha256: str = ""
    """Digest of its source file."""


class SinusoidsSetpoint(TargetTable):
    """A set-point by the terms of its rate ṙ(t): sinusoids in windows, and jumps.

    A set-point from user code is also recorded in this form.
    """

    kind: Literal["sinusoids"]
    rate: Annotated[list[Term], Len(1, MOST_INTERVALS)]
    """Terms (a, ω, φ, start, end) of ṙ(t) [unit per s; rad/s; rad; s; s]: a cos(ωt + φ) from ``start`` to ``end``; a
    term that ends when it starts is a jump by a. Times are from ``start`` of the set-point on."""
    made_by: Line = ""
    """Code that gave the terms, as ``module:name``."""
    sha256: str = ""
    """Digest of its source file."""

    @property
    def ends_with_run(self) -> bool:
        """What code has drawn may depend on the duration of the run."""
        return bool(self.made_by)

    def terms(self, end: float) -> Array:
        found = np.array(self.rate, dtype=float)
        found[:, 2] -= found[:, 1] * self.start
        found[:, 3:] += self.start
        return found


DISTURBANCE, SETPOINT = SinusoidsTable, SinusoidsSetpoint
