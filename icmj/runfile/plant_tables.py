"""The tables of the two plants: what the controller believes in, and what is really there."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from icmj.errors import ModelError
from icmj.plant.change import Change, What
from icmj.plant.operating import OperatingKind, OperatingRule
from icmj.plant.person import Person
from icmj.plant.selection import Selection
from icmj.runfile.person import PersonTable
from icmj.runfile.table import (
    Finite,
    NonNegative,
    Numbers,
    TomlTable,
)


class PlantTable(TomlTable):
    """What both plants have: operating point, inputs, outputs and states, by name."""

    keyframe: str | None = None
    operating_point: OperatingKind | None = None
    free: list[str] = []
    pose: dict[str, Finite] = {}
    inputs: list[str] | None = None
    outputs: list[str] | Literal["joints"] | None = None
    states: list[str] | None = None
    drop: list[str] = []
    person: PersonTable | None = None

    @property
    def measures(self) -> Person | None:
        """Whose measures the model gets, if anyone's."""
        return self.person.person() if self.person else None

    @property
    def operating(self) -> OperatingRule:
        """The rule for the operating point that it stands for."""
        return OperatingRule(self.operating_point or "as given", tuple(self.free), self.pose)

    @model_validator(mode="after")
    def _only_balance_frees(self) -> PlantTable:
        if self.free and self.operating_point != "balance":
            raise ValueError('free needs operating_point = "balance"')
        return self

    @property
    def selection(self) -> Selection:
        """The selection that it stands for."""
        outputs = self.outputs if isinstance(self.outputs, str) else _names(self.outputs)
        return Selection(_names(self.inputs), outputs, _names(self.states), tuple(self.drop))


class Assumed(PlantTable):
    """The plant that the controller believes in."""

    model: str
    delay: NonNegative = 0.0


class ChangeTable(TomlTable):
    """One named change; see :mod:`icmj.plant.change` for what there is."""

    what: What
    of: str | None = None
    factor: Finite | None = None
    value: Finite | list[Finite] | None = None

    def change(self) -> Change:
        """The change that it stands for.

        Raises:
            ModelError: if it is not one.
        """
        value = tuple(self.value) if isinstance(self.value, list) else self.value
        return Change(self.what, self.of, self.factor, value)

    @model_validator(mode="after")
    def _is_one(self) -> ChangeTable:
        try:
            self.change()
        except ModelError as error:
            raise ValueError(str(error)) from error
        return self


class Actual(PlantTable):
    """The plant that is really there: another model, or the same one, with or without changes.

    Where it names no inputs or outputs they are those of the assumed plant, by name; where it has no operating point it
    finds its own by the assumed plant's rule, from where the assumed plant rests.
    """

    model: str | None = None
    gain: Finite | Numbers = 1.0
    dynprm: dict[str, Annotated[list[Finite], Field(max_length=10)]] = {}  # as many as MuJoCo keeps
    change: list[ChangeTable] = []
    rho: Finite = 1.0
    delay: NonNegative | None = None


def _names(given: list[str] | None) -> tuple[str, ...] | None:
    return None if given is None else tuple(given)
