"""The tables of the two plants: what the controller believes in, and what is really there."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from icmj.errors import ModelError
from icmj.plant.change import Change, What
from icmj.plant.operating import OperatingKind, OperatingRule
from icmj.plant.person import Person
from icmj.plant.selection import Selection
from icmj.runfile.matrix_tables import MatrixTable
from icmj.runfile.person import PersonTable
from icmj.runfile.table import (
    Finite,
    NonNegative,
    Numbers,
    Parameters,
    Reference,
    TomlTable,
)

ON_ENGINE = ("keyframe", "operating_point", "free", "pose", "drop", "person", "dynprm", "change", "edit")
"""Keys of a plant that only a model has."""


class PlantTable(MatrixTable):
    """What both plants have: a model with its operating point, or matrices; inputs, outputs and states, by name."""

    model: str | None = None
    """MJCF file, beside the run file; of the actual plant the assumed one's if none is named."""

    keyframe: str | None = None
    """Of the model, where it rests; the reference configuration if none is named."""
    operating_point: OperatingKind | None = None
    """What follows from the pose: ``"as given"`` nothing, ``"static control"`` the controls that hold it,
    ``"balance"`` those and the joints. By default as given; of the actual plant, as of the assumed one."""
    free: list[str] = []
    """Joints that a balance may move; all if none is named."""
    pose: dict[str, Finite] = {}
    """Joints by name, and where they are instead of in the keyframe [rad or m]."""
    inputs: list[str] | None = None
    """Actuators that the controller uses, in this order; all by default."""
    outputs: list[str] | Literal["joints"] | None = None
    """Sensors, entries ``sensor.0`` of one, or joints, in this order; ``"joints"`` takes all joints; by default all
    sensors."""
    states: list[str] | None = None
    """States that are kept; all by default."""
    drop: list[str] = []
    """States that are left out."""
    person: PersonTable | None = None
    """Measures of the person that the model is made into."""

    @property
    def measures(self) -> Person | None:
        """Whose measures the model gets, if anyone's."""
        return self.person.person() if self.person else None

    @property
    def operating(self) -> OperatingRule:
        """The rule for the operating point that it stands for."""
        named = self.keyframe is not None or self.pose
        return OperatingRule(self.operating_point or ("as given" if named else "found"), tuple(self.free), self.pose)

    @model_validator(mode="after")
    def _model_or_matrices(self) -> PlantTable:
        if self.given:
            self.refuse(("model", *ON_ENGINE), "a plant given by matrices")
            if self.outputs == "joints":
                raise ValueError("a plant given by matrices has no joints; name its outputs")
        elif self.units:
            raise ValueError("units are those of a plant given by matrices; a model's are known")
        return self

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

    delay: NonNegative = 0.0
    """That the predictor bridges [s]."""

    @model_validator(mode="after")
    def _is_there(self) -> Assumed:
        if not self.given and self.model is None:
            raise ValueError("no plant; name its model, or give matrices A, B and C")
        return self


class ChangeTable(TomlTable):
    """One named change; see :mod:`icmj.plant.change` for what there is."""

    what: What
    """The property that is changed."""
    of: str | None = None
    """Whose, by name; without it, of all that have it."""
    factor: Finite | None = None
    """On it, or"""
    value: Finite | list[Finite] | None = None
    """in its place [unit of the property]."""

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

    gain: Finite | Numbers = 1.0
    """b in ctrl = ctrl₀ + b (u + d): a number for all inputs, or one for each, in the order of ``inputs``."""
    dynprm: dict[str, Annotated[list[Finite], Field(max_length=10)]] = {}  # as many as MuJoCo keeps
    """First parameters of the dynamics of actuators, by name."""
    change: list[ChangeTable] = []
    """Whatever else is wrong with the assumed model."""
    edit: Reference | None = None
    """The ``module:name`` of a function that changes the model itself: it is given the ``mujoco.MjSpec`` and ρ."""
    edit_parameters: Parameters = {}
    """Of that function, by name."""
    rho: Finite = 1.0
    """Share ρ of all changes that is applied: 0 none, 1 the whole."""
    delay: NonNegative | None = None
    """That is there [s]; the assumed one by default."""


def _names(given: list[str] | None) -> tuple[str, ...] | None:
    return None if given is None else tuple(given)
