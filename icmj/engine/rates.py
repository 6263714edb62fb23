"""How fast a closed loop moves between events, by its linearisation, and whether it is stiff."""

from __future__ import annotations

import numpy as np

from icmj.controller.controller import Controller, realise
from icmj.engine.tableau import STIFF
from icmj.plant.linear_plant import LinearPlant


def is_stiff(plant: LinearPlant, fastest: float) -> bool:
    """Whether a loop with this ``fastest`` rate [1/s] is much faster than the plant's own slow motion."""
    rates = np.abs(np.linalg.eigvals(plant.A))
    moving = rates[rates > 1e-3 * fastest]
    return bool(fastest > STIFF * moving.min(initial=fastest))


def fastest_rate(plant: LinearPlant, controller: Controller) -> float:
    """Largest |λ| of plant, observer and hold between events [rad/s]."""
    controls = realise(controller)
    closed = np.block([[plant.A, -plant.B @ controls.K], [controls.N @ plant.C, controls.M]])
    return float(np.abs(np.linalg.eigvals(closed)).max())
