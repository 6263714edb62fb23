"""Predictions under way: what the controller foresaw at its events and has not set the hold to yet."""

from __future__ import annotations

from collections import deque
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.controller.delay import SAME, predictor

_DIGITS = 1e12  # times are told apart to this part of a second


class Pending(NamedTuple):
    """A prediction: when its event was [s], and the state foreseen, shape (n̂,)."""

    event: float
    x_p: Array


class Queue:
    """The predictions of a controller with a delay that have not acted yet, the oldest first."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self._under_way: deque[Pending] = deque()
        self._predictor = lru_cache(64)(self._make)

    def take_up(self, t: float, x_o: Array, x_h: Array) -> None:
        """An event at ``t``: foresee the state at its action."""
        waited = self.controller.delay.expected([t - p.event for p in self._under_way])
        times = tuple(int(time * _DIGITS + 0.5) / _DIGITS for time in waited)
        expected = list(self._under_way)[len(self._under_way) - len(times) :]
        E_p = self._predictor(times)
        self._under_way.append(Pending(t, E_p @ np.concatenate([x_o, x_h, *(p.x_p for p in expected)])))

    @property
    def due(self) -> float:
        """When the next prediction is due [s]; infinity if none is under way."""
        if not self._under_way:
            return float("inf")
        delay, clock = self.controller.delay.t_d, self.controller.trigger.clock
        at = self._under_way[0].event + delay
        if np.isfinite(clock) and abs(at / clock - round(at / clock)) < SAME:
            return round(at / clock) * clock
        return at

    def act(self) -> Array:
        """The prediction that is due now: what x_h is set to."""
        return self._under_way.popleft().x_p

    def _make(self, times: tuple[float, ...]) -> Array:
        controller = self.controller
        return predictor(controller.design, controller.hold, controller.delay.predicted, times)
