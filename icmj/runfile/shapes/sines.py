"""A sum of sinusoids of chosen frequencies [Hz], with given or random phases."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import model_validator

from icmj.base.array import Array, Finite, Numbers, Positives, Seed
from icmj.controller.setpoint import sines
from icmj.errors import SimulationError
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import TomlTable, keys_of
from icmj.runfile.target import TargetTable
from icmj.simulation.sources import Sinusoids, Source


class HarmonicTable(TomlTable):
    """A course that is a sum of sinusoids."""

    size: Finite | Numbers
    """Amplitude a: one number for all, or one for each sinusoid [unit of the signal]."""
    frequencies: Positives
    """Frequency f of each sinusoid [Hz]."""
    phases: Numbers | None = None
    """Phase φ of each sinusoid [rad]. By default, phases are drawn at random."""
    seed: Seed = 0
    """Seed of the phases."""

    @property
    def all_phases(self) -> Array:
        """The phases, also those that are drawn [rad]."""
        drawn = 2 * np.pi * np.random.default_rng(self.seed).random(len(self.frequencies))
        return drawn if self.phases is None else np.array(self.phases)


@keys_of(Sinusoids, without=("terms",))
class SinesTable(HarmonicTable, PlaceTable):
    """A sum of sinusoids, Σ a cos(2πf t + φ), with given frequencies."""

    kind: Literal["sines"]

    def source(self) -> Source:
        count, phases = len(self.frequencies), self.all_phases
        size = np.atleast_1d(np.asarray(self.size, dtype=float))
        if len(phases) != count or len(size) not in (1, count):
            raise SimulationError(f"sines: {count} frequencies; expected as many phases, and one size or as many")
        terms = np.column_stack([np.broadcast_to(size, count), 2 * np.pi * np.array(self.frequencies), phases])
        return self.make_source(Sinusoids, terms=tuple(map(tuple, terms.tolist())))


class SinesSetpoint(HarmonicTable, TargetTable):
    """A sum of sinusoids, Σ a sin(2πf(t − start) + φ)."""

    kind: Literal["sines"]

    def terms(self, end: float) -> Array:
        return sines(self.size, self.frequencies, self.all_phases, self.start)

    @model_validator(mode="after")
    def _one_for_each(self) -> SinesSetpoint:
        count = len(self.frequencies)
        for key in ("size", "phases"):
            given = getattr(self, key)
            if isinstance(given, list) and len(given) != count:
                raise ValueError(f"{key} has {len(given)} numbers for {count} frequencies")
        if self.phases is not None and "seed" in self.model_fields_set:
            raise ValueError("give either phases or their seed")
        return self


DISTURBANCE, SETPOINT = SinesTable, SinesSetpoint
