"""Inputs on which something else acts than the command: what the limits of the actuators pass, and a disturbance."""

from __future__ import annotations

import numpy as np

from icmj.result.result import Result
from icmj.result.tried import Tried


def acting(result: Result | Tried) -> list[int]:
    """Indices of the inputs where ``applied`` is not ``u``; a difference by rounding is none."""
    simulation = result.simulation
    if not simulation.applied.size:
        return []
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(simulation.applied - simulation.u)
        differs = (apart > 1e-9 * np.abs(simulation.u)) & (apart > 1e-9 * np.nanmax(apart, initial=0.0))
    return [int(i) for i in np.flatnonzero(differs.any(axis=0))]
