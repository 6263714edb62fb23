"""What every controller answers, whatever theory it stands for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from icmj.controller.realisation import Realisation
from icmj.plant.linear_plant import LinearPlant
from icmj.work.own_code import Fact, digest_of, plain, reference_of


class Law(ABC):
    """A controller: simulations ask this, and how it moves (:class:`icmj.controller.realisation.Realisation`).

    One of one's own is a frozen dataclass that is a ``Law``.
    """

    @property
    @abstractmethod
    def plant(self) -> LinearPlant:
        """The plant that it takes the actual one for: its inputs and outputs, in this order, are the controller's."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """One word for tables and logs."""

    @property
    @abstractmethod
    def realisation(self) -> Realisation:
        """How it moves.

        Raises:
            AnalysisError: if its parts do not fit.
        """

    @abstractmethod
    def facts(self) -> Mapping[str, Any]:
        """What there is to say of it, by the field's names, for tables and summaries."""


@dataclass(frozen=True, eq=False)
class RecordedLaw(Law):
    """A controller of somebody's own code as a log keeps it: how it moves, in numbers, and where it came from.

    Attributes:
        assumed: the plant that it was made for.
        moves: its realisation.
        called: its ``kind``.
        reference: ``module:name`` of its class.
        sha256: digest of the source file; "" where there was none.
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
