"""Coloured noise: a sum of sinusoids of random phases, flat up to a bandwidth or a first-order low-pass."""

from __future__ import annotations

from typing import ClassVar, Literal

from icmj.base.array import Positive, Seed
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import keys_of
from icmj.simulation.sources import Noise


@keys_of(Noise)
class NoiseTable(PlaceTable):
    """Coloured noise on one input or body, or on one output as the observer reads it.

    Its standard deviation is ``size``. Its spectrum is flat up to ``bandwidth`` [Hz], or a first-order low-pass with a
    ``corner`` [Hz]; see :class:`icmj.simulation.sources.Noise`.
    """

    unknown_size: ClassVar[bool] = True

    kind: Literal["noise"]
    size: Positive | None = None
    seed: Seed


DISTURBANCE = NoiseTable
