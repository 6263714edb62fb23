"""What every controller answers, whatever theory it stands for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from icmj.controller.realisation import Realisation
from icmj.plant.linear_plant import LinearPlant


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
