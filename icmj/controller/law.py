"""The interface of every controller."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from icmj.controller.realisation import Realisation
from icmj.controller.setpoint import Setpoint
from icmj.plant.linear_plant import LinearPlant
from icmj.work.own_code import Fact, digest_of, plain, reference_of


class Law(ABC):
    """A controller; simulations use this interface and its :class:`icmj.controller.realisation.Realisation`.

    Your own controller is a frozen dataclass that inherits from ``Law``.

    Attributes:
        setpoint: the set-point r(t) that the controller follows; ``None`` if it has none.
    """

    setpoint: Setpoint | None = None

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


def recorded_law(law: Law) -> Law:
    """A controller as a log keeps it: itself, but for one that is not of icmj."""
    if type(law).__module__.startswith(f"{__package__}."):
        return law
    named: list[str] = [f.name for f in fields(law)] if is_dataclass(law) else []
    parameters = {name: plain(getattr(law, name)) for name in named if getattr(law, name) is not law.plant}
    return RecordedLaw(law.plant, law.realisation, law.kind, reference_of(law), digest_of(law), parameters)
