"""Outputs as people read them: angles in degrees, everything else in the unit that it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from icmj.case.result import Result
from icmj.controller.law import Law
from icmj.plant.linear_plant import LinearPlant


@dataclass(frozen=True)
class Quantity:
    """The way in which an output is shown.

    Attributes:
        factor: on its value in SI units.
        unit: such as deg or m; "" where the plant does not know it.
    """

    factor: float
    unit: str

    def label(self, words: str, per: str = "") -> str:
        """``words`` with the unit in brackets, as ``angle (deg/s)`` for ``per`` "/s"; alone where there is none."""
        return in_unit(words, self.unit and self.unit + per)


def in_unit(words: str, unit: str) -> str:
    """``words`` with the unit in brackets; alone where there is none."""
    return f"{words} ({unit})" if unit else words


def in_brackets(unit: str, per: str = "") -> str:
    """`` [rad/s]`` for rad and "/s", to be put behind a name; nothing where there is no unit."""
    return f" [{unit}{'' if unit == EACH else per}]" if unit else ""


EACH = "each in its own unit"


def shared_unit(units: Sequence[str]) -> str:
    """The unit of all where they have the same one, the words :data:`EACH` where not; "" where none is known."""
    return units[0] if len(set(units)) == 1 else EACH if units else ""


def quantities(plant: LinearPlant) -> tuple[Quantity, ...]:
    """One for each output of ``plant``."""
    return tuple(_quantity(unit) for unit in plant.output_units or ("",) * plant.n_y)


def threshold_unit(result: Result) -> str:
    """Unit of the threshold of a run; see :func:`rule_unit`."""
    return rule_unit(result.assumed, result.controller)


def rule_unit(plant: LinearPlant, controller: Law) -> str:
    """Unit of the threshold: that of the assumed outputs where the rule weighs these alone; "" where it has none."""
    facts = controller.facts()
    weight = facts.get("Q_t")
    of_outputs = facts.get("on") == "output"
    if isinstance(weight, np.ndarray):
        of_outputs = weight.shape == (plant.n, plant.n) and np.allclose(weight, plant.C.T @ plant.C, atol=1e-12)
    return shared_unit(plant.output_units) if of_outputs else ""


def _quantity(unit: str) -> Quantity:
    if unit == "rad" or unit.startswith("rad/"):
        return Quantity(180 / np.pi, unit.replace("rad", "deg"))
    return Quantity(1.0, unit)
