"""How fast a closed loop moves between events, by its linearisation, and whether it is stiff."""

from __future__ import annotations

import numpy as np

from icmj.controller.law import Law
from icmj.engine.tableau import STIFF
from icmj.plant.linear_plant import LinearPlant


def is_stiff(plant: LinearPlant, fastest: float) -> bool:
    """Whether a loop with this ``fastest`` rate [1/s] is much faster than the plant's own slow motion."""
    rates = np.abs(np.linalg.eigvals(plant.A))
    moving = rates[rates > 1e-3 * fastest]
    return bool(fastest > STIFF * moving.min(initial=fastest))


def fastest_rate(plant: LinearPlant, controller: Law) -> float:
    """Largest |λ| of plant and controller between events, in any mode, as if nothing were delayed [rad/s]."""
    controls = controller.realisation
    fastest = 0.0
    for mode in controls.modes:
        read = controls.read(plant.C, mode)
        closed = np.block([[plant.A, -plant.B @ mode.K], [np.zeros((len(mode.M), plant.n)), mode.M]])
        closed += np.vstack([-plant.B @ mode.S[:, : len(read)], mode.N[:, : len(read)]]) @ read
        fastest = max(fastest, float(np.abs(np.linalg.eigvals(closed)).max()))
    return fastest
