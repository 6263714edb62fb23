"""The tables of the two plants: the one that the controller assumes, and the actual one.

Each is of a model, a person or matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from icmj.base.array import Finite, Matrix, NonNegative, Numbers
from icmj.plant.activation import Activation
from icmj.plant.body import Change, OperatingKind, OperatingRule, Selection
from icmj.plant.person import Person, Segment
from icmj.runfile.table import CHOICE, Parameters, Reference, TomlTable, check_by, keys_of, make

LETTERS = ("A", "B", "C")


class MatrixTable(TomlTable):
    """ẋ = A x + B u, y = C x; states, inputs and outputs are named in the keys of these names, in order."""

    A: Matrix | None = None
    """State matrix of a plant given by matrices, row by row."""
    B: Matrix | Numbers | None = None
    """Input matrix, row by row; for a single input, also a list of its entries."""
    C: Matrix | Numbers | None = None
    """Output matrix, row by row; for a single output, also a list of its entries."""
    B_d: Matrix | Numbers | None = None
    """Effect of a push of size 1 along each input, independent of the input gain, in the form of B (default: B)."""
    matrices: str | None = None
    """File with A, B, C, optionally B_d, and names, relative to the run file: ``.npz``, or ``.json`` as printed by
    ``icmj linearise --json``."""
    units: dict[str, str] = {}
    """Units of states, inputs and outputs of a plant given by matrices, by name."""

    @property
    def given(self) -> bool:
        """Whether it gives a plant by matrices."""
        return self.matrices is not None or any(getattr(self, letter) is not None for letter in LETTERS)

    def refuse(self, foreign: Sequence[str], what: str) -> None:
        """Refuse these keys if they are present.

        Raises:
            ValueError: at the first that is.
        """
        for name in foreign:
            if name in self.model_fields_set:
                raise ValueError(f"{what} has no {name}")

    @model_validator(mode="after")
    def _one_way(self) -> MatrixTable:
        there = [letter for letter in LETTERS if getattr(self, letter) is not None]
        if there and self.matrices is not None:
            raise ValueError(f"give either matrices or {' and '.join(there)}")
        if self.B_d is not None and not there:
            raise ValueError("B_d is given together with A, B and C")
        if there and len(there) < len(LETTERS):
            missing = [letter for letter in LETTERS if letter not in there]
            raise ValueError(f"a plant needs A, B and C; {' and '.join(missing)} is not there")
        return self


@keys_of(Segment, optional=True)
class SegmentTable(TomlTable):
    """Values of a segment that replace the default ones; see :class:`icmj.plant.person.Segment`."""


@keys_of(Person)
class PersonTable(TomlTable):
    """Height [m] and mass [kg], passive torque, and segments; see :class:`icmj.plant.person.Person`."""

    segments: dict[Literal["shank", "thigh", "trunk", "foot"], SegmentTable] = {}
    """Segments by name whose values differ from the default ones."""

    def person(self) -> Person:
        """The person that the table describes."""
        person = make(Person, self, segments={})
        for name, table in self.segments.items():
            person = person.with_segment(name, **table.model_dump(exclude_none=True))
        return person


ON_ENGINE = ("keyframe", "operating_point", "free", "pose", "drop", "person", "dynprm", "change", "edit")
"""Keys of a plant that only a model has."""


@keys_of(Activation)
class ActivationTable(TomlTable):
    """Activation dynamics: a lag between the command of an input and its action, as in muscles.

    One number applies to all inputs; ``{ ankle = 0.1, hip = 0.05 }`` adds a lag only to the inputs that it names.
    """

    order: Annotated[Literal[0, 1, 2], CHOICE]

    def activation(self) -> Activation:
        """The lag that the table describes.

        Raises:
            ModelError: if it is none.
        """
        return make(Activation, self)

    _is_one = check_by("activation")


class PlantTable(MatrixTable):
    """The keys of both plants: a model with an operating point, or matrices; names of inputs, outputs and states."""

    model: str | None = None
    """MJCF file, relative to the run file, or the name of a shipped model, such as ``three_link`` (default of the
    actual plant: that of the assumed plant)."""

    keyframe: str | None = None
    """Keyframe of the operating point (default: the reference configuration)."""
    operating_point: OperatingKind | None = None
    """How the operating point is completed: ``"as given"``, ``"static control"`` (controls only) or ``"balance"``
    (controls and pose). Default: as given; for the actual plant, that of the assumed plant."""
    free: list[str] = []
    """Joints that a balance may move (default: all)."""
    pose: dict[str, Finite] = {}
    """Positions of joints by name, which replace those of the keyframe [rad or m]."""
    inputs: list[str] | None = None
    """Actuators that the controller uses, in this order (default: all)."""
    outputs: list[str] | Literal["joints"] | None = None
    """Outputs in this order: sensors, single entries such as ``sensor.0``, or joints; ``"joints"`` takes all joints
    (default: all sensors)."""
    states: list[str] | None = None
    """States that are kept (default: all)."""
    drop: list[str] = []
    """States that are left out."""
    person: PersonTable | None = None
    """Height, mass and segments to which the model is scaled."""

    activation: ActivationTable | None = None
    """Lag of the inputs, which must be motors, as in muscles (default: none; for the actual plant, the assumed lag)."""

    @property
    def measures(self) -> Person | None:
        """The person whose measures the model gets, if one is given."""
        return self.person.person() if self.person else None

    @property
    def operating(self) -> OperatingRule:
        """The rule for the operating point."""
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
        """The selection of inputs, outputs and states."""
        outputs = self.outputs if isinstance(self.outputs, str) else _names(self.outputs)
        return Selection(_names(self.inputs), outputs, _names(self.states), tuple(self.drop))


class Assumed(PlantTable):
    """The plant that the controller assumes."""

    delay: NonNegative = 0.0
    """Delay for which the predictor compensates [s]."""

    @model_validator(mode="after")
    def _is_there(self) -> Assumed:
        if not self.given and self.model is None:
            raise ValueError("no plant; name its model, or give matrices A, B and C")
        return self


@keys_of(Change)
class ChangeTable(TomlTable):
    """One change of a property; :mod:`icmj.plant.body` lists the properties."""

    def change(self) -> Change:
        """The change that the table describes.

        Raises:
            ModelError: if it is not one.
        """
        return make(Change, self)

    _is_one = check_by("change")


class Actual(PlantTable):
    """The actual plant: another model, or the same one, with or without changes.

    Where it names no inputs or outputs they are those of the assumed plant, by name; where it has no operating point it
    finds its own by the assumed plant's rule, from where the assumed plant rests.
    """

    gain: Finite | Numbers = 1.0
    """Input gain b in ctrl = ctrl₀ + b (u + d): one number for all inputs, or a list in the order of ``inputs``."""
    dynprm: dict[str, Annotated[list[Finite], Field(max_length=10)]] = {}  # as many as MuJoCo keeps
    """First parameters of the dynamics of actuators, by the name of the actuator."""
    change: list[ChangeTable] = []
    """Further differences from the assumed model."""
    edit: Reference | None = None
    """The ``module:name`` of a function that changes the model itself; it receives the ``mujoco.MjSpec`` and ρ."""
    edit_parameters: Parameters = {}
    """Parameters by name of the function ``edit``."""
    rho: Finite = 1.0
    """Share ρ of all changes that is applied, from 0 (none) to 1 (all)."""
    delay: NonNegative | None = None
    """Actual delay [s] (default: the assumed one)."""

    @property
    def changes(self) -> tuple[Change, ...]:
        """The further differences from the assumed model."""
        return tuple(table.change() for table in self.change)


def _names(given: list[str] | None) -> tuple[str, ...] | None:
    return None if given is None else tuple(given)
