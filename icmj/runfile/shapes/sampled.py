"""Values at the points of a regular grid, linear between them; the last one is held."""

from __future__ import annotations

from typing import Literal

from icmj.runfile.place import PlaceTable
from icmj.runfile.table import Line, keys_of
from icmj.simulation.sources import Sampled


@keys_of(Sampled)
class SampledTable(PlaceTable):
    """Values at the points of a regular grid from t = 0 on, with linear interpolation; the last value is held."""

    kind: Literal["sampled"]
    made_by: Line = ""
    """File and column from which the values were read."""


DISTURBANCE = SampledTable
