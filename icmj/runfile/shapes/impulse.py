"""An impulse: constant over a short time, on an input or a body."""

from __future__ import annotations

from typing import Literal

from icmj.base.array import Finite
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import keys_of
from icmj.simulation.sources import Impulse


@keys_of(Impulse)
class ImpulseTable(PlaceTable):
    """An impulse on an input or a body: ``size`` [N m s], constant over ``duration`` [s] from ``start`` [s] on."""

    kind: Literal["impulse"]
    size: Finite | None = None


DISTURBANCE = ImpulseTable
