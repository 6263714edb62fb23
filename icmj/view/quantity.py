"""Outputs as people read them: angles in degrees, everything else in the unit that it has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.plant.linear_plant import LinearPlant


@dataclass(frozen=True)
class Quantity:
    """How an output is shown.

    Attributes:
        factor: on its value in SI units.
        unit: such as deg or m; "" where the plant does not know it.
    """

    factor: float
    unit: str

    def label(self, words: str, per: str = "") -> str:
        """``words`` with the unit in brackets, as ``angle (deg/s)`` for ``per`` "/s"; alone where there is none."""
        return f"{words} ({self.unit}{per})" if self.unit else words


def quantities(plant: LinearPlant) -> tuple[Quantity, ...]:
    """One for each output of ``plant``."""
    return tuple(_quantity(unit) for unit in plant.output_units or ("",) * plant.n_y)


def _quantity(unit: str) -> Quantity:
    if unit == "rad" or unit.startswith("rad/"):
        return Quantity(180 / np.pi, unit.replace("rad", "deg"))
    return Quantity(1.0, unit)
