"""The clock-driven loop from event to event, also where the clock is faster than the delay."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from icmj.base.array import Array
from icmj.controller.controller import Controller, realise
from icmj.plant.linear_plant import LinearPlant


def clocked_map(plant: LinearPlant, controller: Controller) -> Array:
    """What (x, a) right after one event becomes right after the next, shape (n + N_a, n + N_a).

    Args:
        plant: the actual plant.
        controller: with a clock; a its states, predictions under way included.
    """
    controls, n = realise(controller), plant.n
    interval, delay = controller.trigger.clock, controller.delay
    F = np.block([[plant.A, -plant.B @ controls.K], [controls.N @ plant.C, controls.M]])

    def at(jump: Array) -> Array:
        whole = np.eye(len(F))
        whole[n:, n:] = jump
        return whole

    if not delay:
        return np.asarray(at(controls.J) @ expm(F * interval))
    # of the events under way one acts in each interval; where the delay is a multiple of it, just before the next event
    acts = delay.t_d - (delay.in_flight(interval) - 1) * interval
    rest = max(interval - acts, 0.0)
    return np.asarray(at(controls.J) @ expm(F * rest) @ at(controls.G) @ expm(F * acts))


def is_stable(plant: LinearPlant, controller: Controller) -> bool:
    """Whether every eigenvalue of the clock-driven loop lies inside the unit circle.

    Predictions are remembered, so that some are zero; none can be one that nothing sees.
    """
    return bool(np.abs(np.linalg.eigvals(clocked_map(plant, controller))).max() < 1)
