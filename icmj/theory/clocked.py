"""The clock-driven loop from event to event, also where the clock is faster than the delay."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from icmj.base.array import Array
from icmj.controller.closed_loop import compose
from icmj.controller.controller import Controller
from icmj.plant.linear_plant import LinearPlant


def clocked_map(plant: LinearPlant, controller: Controller) -> Array:
    """Matrix from (x, a) right after one event to (x, a) right after the next, shape (n + N_a, n + N_a).

    Args:
        plant: the actual plant.
        controller: with a clock; a its states, predictions under way included.
    """
    loop = compose(plant, controller)
    interval, delay = controller.trigger.clock, controller.delay
    if not delay:
        return np.asarray(loop.J @ expm(loop.F * interval))
    # of the events under way one acts in each interval; where the delay is a multiple of it, just before the next event
    acts = delay.t_d - (delay.in_flight(interval) - 1) * interval
    rest = max(interval - acts, 0.0)
    return np.asarray(loop.J @ expm(loop.F * rest) @ loop.G @ expm(loop.F * acts))


def is_stable(plant: LinearPlant, controller: Controller) -> bool:
    """Whether every eigenvalue of the clock-driven loop lies inside the unit circle.

    Predictions are remembered, so that some are zero; none can be one that nothing sees.
    """
    return bool(np.abs(np.linalg.eigvals(clocked_map(plant, controller))).max() < 1)
