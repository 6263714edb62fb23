"""A plant given by its matrices, in place of a model of the engine."""

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
        """The plant in the form that a case holds."""
        return cls(Given(plant))

    @property
    def states(self) -> tuple[str, ...]:
        """All states."""
        return self.linearisation.plant.states

    @property
    def told(self) -> tuple[Notice, ...]:
        """Notices on choices that were made for the user: none."""
        return ()

    @cached_property
    def quality(self) -> Quality:
        """The quality of the operating point: its modes; all other checks apply to models only."""
        plant = self.linearisation.plant
        return Quality(
            Residual(0.0, plant.states[0], "", 0.0),
            neutral=neutral(plant),
            uncontrollable=uncontrollable(plant),
            unobservable=unobservable(plant),
            idle=idle(plant),
        )
