"""A bias: a constant error of an output as the observer reads it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from icmj.runfile.place import DisturbanceTable
from icmj.runfile.table import keys_of, make
from icmj.simulation.sources import Bias, Source


@keys_of(Bias)
class BiasTable(DisturbanceTable):
    """A constant error of one output as the observer reads it: ``size`` from ``start`` [s] on."""

    kind: Literal["bias"]

    def sources(self) -> Iterator[Source]:
        """The source that it stands for."""
        yield make(Bias, self)


DISTURBANCE = BiasTable
