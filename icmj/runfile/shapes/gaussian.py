"""Gaussian noise at the points of a grid, of constant size or in proportion to the command."""

from __future__ import annotations

from typing import Literal

from icmj.base.array import Positive, Seed
from icmj.errors import SimulationError
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import keys_of
from icmj.simulation.sources import Gaussian, Source


@keys_of(Gaussian)
class GaussianTable(PlaceTable):
    """Gaussian noise on one input or body, or on one output as the observer reads it.

    Its spectrum is white, or a first-order low-pass with a ``corner`` [Hz]. Its distribution is exact at the points of
    a grid; see :class:`icmj.simulation.sources.Gaussian`.
    """

    kind: Literal["gaussian"]
    size: Positive | None = None
    share: Positive | None = None
    """Instead of ``size``, for an ``input``: standard deviation as a share of the controller's command to it, as in
    signal-dependent motor noise. The noise is this share times the command times noise of variance one. Needs a
    controller whose command follows from a hold between events."""
    seed: Seed

    def source(self) -> Source:
        """The source that it stands for."""
        if self.share is not None and self.size is not None:
            raise SimulationError("gaussian: give size or share, not both")
        return self.make_source(Gaussian, **({"share": self.share} if self.share else {"size": self.full_size}))


DISTURBANCE = GaussianTable
