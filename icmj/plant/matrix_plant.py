"""A plant given by its matrices: what stands where a model of the engine would, with nothing behind it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from icmj.plant.linear_plant import LinearPlant
from icmj.plant.modes import idle, neutral, uncontrollable, unobservable
from icmj.plant.notice import Notice
from icmj.plant.quality import Quality, Residual


@dataclass(frozen=True, eq=False)
class Given:
    """The linearisation of a plant that is linear: the plant itself."""

    plant: LinearPlant


@dataclass(frozen=True, eq=False)
class MatrixPlant:
    """A plant that is linear everywhere, and at rest at zero.

    Attributes:
        linearisation: holds the plant.
    """

    linearisation: Given

    @classmethod
    def of(cls, plant: LinearPlant) -> MatrixPlant:
        """The plant as one that a case can hold."""
        return cls(Given(plant))

    @property
    def states(self) -> tuple[str, ...]:
        """All states."""
        return self.linearisation.plant.states

    @property
    def told(self) -> tuple[Notice, ...]:
        """What was chosen where nothing was named: nothing is."""
        return ()

    @cached_property
    def quality(self) -> Quality:
        """Its modes; the rest of what is asked of a model's operating point cannot be wrong here."""
        plant = self.linearisation.plant
        return Quality(
            Residual(0.0, plant.states[0], "", 0.0),
            neutral=neutral(plant),
            uncontrollable=uncontrollable(plant),
            unobservable=unobservable(plant),
            idle=idle(plant),
        )
