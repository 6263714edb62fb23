"""The interface of every controller, and a controller of which nothing but its numbers is kept."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, ClassVar

import numpy as np

from icmj.controller.realisation import Realisation
from icmj.controller.setpoint import Setpoint
from icmj.controller.trigger import EventRule, Faces, make_no_faces
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant
from icmj.work.own_code import Fact, digest_of, plain, reference_of


class Law(ABC):
    """A controller; simulations use this interface and its :class:`icmj.controller.Realisation`.

    Your own controller is a frozen dataclass that inherits from ``Law``.

    Attributes:
        setpoint: the set-point r(t) that the controller follows; ``None`` if it has none.
        observed: whether its states are those of an observer and a hold, which runs record; true of
            :class:`icmj.Controller` alone.
    """

    setpoint: Setpoint | None = None
    observed: ClassVar[bool] = False

    @property
    def event_rule(self) -> EventRule | None:
        """The event rule of its hold error, on which the theory rests; ``None`` if it has none."""
        return None

    @property
    @abstractmethod
    def plant(self) -> LinearPlant:
        """The assumed plant; the controller has its inputs and outputs, in the same order."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """One word for tables and logs."""

    @property
    @abstractmethod
    def realisation(self) -> Realisation:
        """Its modes, states and resets.

        Raises:
            AnalysisError: if its parts do not fit together.
        """

    @abstractmethod
    def facts(self) -> Mapping[str, Any]:
        """Its parameters by their usual names, for tables and summaries."""

    @property
    def faces(self) -> Faces:
        """Faces of its event rule; of one without a rule there are none."""
        return make_no_faces(self.plant.n)

    def to_record(self) -> Law:
        """The controller as a log keeps it: itself, but for what of it is not of icmj."""
        if type(self).__module__.startswith("icmj."):
            return self
        named: list[str] = [f.name for f in fields(self)] if is_dataclass(self) else []
        parameters = {name: plain(getattr(self, name)) for name in named if getattr(self, name) is not self.plant}
        return RecordedLaw(self.plant, self.realisation, self.kind, reference_of(self), digest_of(self), parameters)


@dataclass(frozen=True, eq=False)
class RecordedLaw(Law):
    """A controller from user code, as a log stores it: its realisation as numbers, and its origin.

    Attributes:
        assumed: the plant for which it was made.
        moves: its realisation.
        called: its ``kind``.
        reference: ``module:name`` of its class.
        sha256: digest of the source file; "" if there was none.
        parameters: the fields of its dataclass, by name.
    """

    assumed: LinearPlant
    moves: Realisation
    called: str
    reference: str
    sha256: str
    parameters: Mapping[str, Fact] = field(default_factory=dict)

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    @property
    def kind(self) -> str:
        return self.called

    @property
    def realisation(self) -> Realisation:
        return self.moves

    def facts(self) -> Mapping[str, Any]:
        return {"controller": self.reference, **self.parameters}


def expect_part(part: object, kind: type, example: str = "") -> None:
    """Refuse a part of a controller, which is called as its class is, of another class; AnalysisError."""
    if not isinstance(part, kind):
        name = kind.__name__
        raise AnalysisError(f"the controller's {name.lower()} is a {type(part).__name__}; expected a {name}{example}")


def expect_setpoint(given: Setpoint | None, plant: LinearPlant) -> None:
    """Refuse a set-point that a controller of this assumed plant cannot follow; it may have none.

    Raises:
        AnalysisError: if it is no set-point, or its steady states are of another plant.
    """
    if given:
        expect_part(given, Setpoint)
        if len(given.x_ss) != plant.n:
            raise AnalysisError("the set-point's steady states are not of the controller's model; make it for that one")


def find_output(outputs: tuple[str, ...], name: str, what: str) -> int:
    """The place of an output that a controller reads; AnalysisError if there is none of this name."""
    if name not in outputs:
        raise AnalysisError(f"the {what} is the output {name!r}; the plant's outputs are {', '.join(outputs)}")
    return outputs.index(name)


def find_input(plant: LinearPlant, name: str, what: str = "the input") -> int:
    """The place of the input that a controller commands; without a name that of the only one.

    Raises:
        AnalysisError: if there is none of this name, or several and no name.
    """
    if (name and name not in plant.inputs) or (not name and len(plant.inputs) > 1):
        raise AnalysisError(f"name {what}, one of {', '.join(plant.inputs)}")
    return plant.inputs.index(name) if name else 0


def expect_positive(value: float, what: str) -> None:
    """Refuse a time [s] that is not positive and finite; AnalysisError."""
    if not (np.isfinite(value) and value > 0):
        raise AnalysisError(f"the {what} must be positive, got {value} s")


def expect_law(law: Law, plant: LinearPlant) -> Law:
    """See that a controller of the user's own is one for this assumed plant; all that is asked of it is asked once.

    Raises:
        AnalysisError: if it has no realisation, or one of other inputs and outputs than the plant's.
    """
    asked = {"realisation": (law.realisation, Realisation), "plant": (law.plant, LinearPlant), "kind": (law.kind, str),
             "facts()": (law.facts(), Mapping)}  # fmt: skip
    for name, (found, kind) in asked.items():
        if not isinstance(found, kind):
            raise AnalysisError(f"its {name} is a {type(found).__name__}; expected a {kind.__name__}")
    if (law.plant.inputs, law.plant.outputs) != (plant.inputs, plant.outputs):
        raise AnalysisError("its plant has other inputs or outputs than the assumed plant")
    real = law.realisation
    readings = len(real.taps) * (plant.n_y + plant.n_u * real.commands) + len(np.unique(real.signals[:, 0]))
    if real.K.shape[0] != plant.n_u or real.N.shape[1] < readings:
        raise AnalysisError(
            f"its realisation has {real.K.shape[0]} commands and {real.N.shape[1]} readings; the assumed plant takes "
            f"{plant.n_u}, and gives {readings}"
        )
    return law
