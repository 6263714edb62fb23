"""The tables of disturbances that are sums of chosen sinusoids: some, or those of a pseudo-random sequence."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from icmj.errors import SimulationError
from icmj.runfile.place_table import PlaceTable
from icmj.runfile.table import Finite, Numbers, Positive, Positives
from icmj.simulation.sources import Sinusoids, Source
from icmj.simulation.surface import ternary_lines


class SinesTable(PlaceTable):
    """A sum of sinusoids, Σ a cos(2πf t + φ), with given frequencies."""

    kind: Literal["sines"]
    """Kind of the disturbance."""
    size: Finite | Numbers
    """Amplitude a: one number for all, or one for each sinusoid [unit of the disturbed signal]."""
    frequencies: Positives
    """Frequency f of each sinusoid [Hz]."""
    phases: Numbers | None = None
    """Phase φ of each sinusoid [rad]. By default, phases are drawn at random."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of the phases."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""

    def source(self) -> Source:
        count = len(self.frequencies)
        drawn = 2 * np.pi * np.random.default_rng(self.seed).random(count)
        phases = drawn if self.phases is None else np.array(self.phases)
        size = np.atleast_1d(np.asarray(self.size, dtype=float))
        if len(phases) != count or len(size) not in (1, count):
            raise SimulationError(f"sines: {count} frequencies; expected as many phases, and one size or as many")
        terms = np.column_stack([np.broadcast_to(size, count), 2 * np.pi * np.array(self.frequencies), phases])
        return Sinusoids(input=self.input, output=self.output, terms=tuple(map(tuple, terms.tolist())), **self.placed)


class TernaryTable(PlaceTable):
    """A pseudo-random ternary sequence of velocities −v, 0, v, integrated: the sum of its lines up to ``bandwidth``.

    It repeats after 242 intervals. As a sum of sinusoids it is smooth, like the motion of a platform.
    """

    kind: Literal["ternary"]
    """Kind of the disturbance."""
    size: Finite
    """Peak-to-peak size of the sequence [unit of the disturbed signal]. A negative size gives the mirror image."""
    interval: Annotated[Positive, Field(ge=1e-3)] = 0.25
    """Duration of each velocity [s]."""
    bandwidth: Positive | None = None
    """Highest line [Hz] (default: half of 1 / interval)."""
    output: str | None = None
    """Name of the output whose reading is disturbed, instead of an input or body."""

    def source(self) -> Source:
        highest = 0.5 / self.interval if self.bandwidth is None else self.bandwidth
        terms = ternary_lines(self.size, self.interval, highest)
        if not len(terms) and abs(self.size) < np.finfo(float).tiny:
            raise SimulationError(f"ternary: nothing is left of a size of {self.size:g}; leave the disturbance out")
        if not len(terms):
            raise SimulationError(
                f"ternary: no line up to {highest:g} Hz; the first is at {1 / 242 / self.interval:g} Hz"
            )
        return Sinusoids(input=self.input, output=self.output, terms=tuple(map(tuple, terms.tolist())), **self.placed)
