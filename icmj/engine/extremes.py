"""Extremes of the outputs between events, to better than the integrator's order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from icmj.base.array import Array
from icmj.base.instants import ONE_INSTANT

POINTS = 6  # a quintic: its sixth-order error stays below that of the fourth-order integrator

Jumps = Callable[[float, float], Array]


class ExtremesTracker:
    """Largest and smallest output of each open-loop interval, from the outputs at every step.

    Chunks of steps are added as they come; only the steps of the interval under way are kept.
    """

    def __init__(self, t: float, y: Array, jumps: Jumps | None = None) -> None:
        """Start at ``t`` with outputs ``y`` (n_y,).

        ``jumps`` gives the times between two others at which accelerations may jump.
        """
        self._jumps = jumps or (lambda start, end: np.zeros(0))
        self._t = np.array([t])
        self._y = np.array([y])
        self._max: list[Array] = []
        self._min: list[Array] = []

    def add(self, t: Array, y: Array, event_at: np.ndarray) -> None:
        """Add steps at ``t`` (M,) with outputs ``y`` (M, n_y), of which those at ``event_at`` end an interval."""
        from icmj.engine.native.extremes import extremes

        at = np.asarray(event_at, dtype=int) + len(self._t)
        self._t = np.concatenate([self._t, t])
        self._y = np.concatenate([self._y, y])
        start = 0
        for end in at:
            t_i, y_i = self._t[start : end + 1], self._y[start : end + 1]
            inside = self._jumps(float(t_i[0]), float(t_i[-1]))
            # a jump at either end cuts nothing, whatever the last bit of its time is
            inside = inside[(inside - t_i[0] > ONE_INSTANT) & (t_i[-1] - inside > ONE_INSTANT)]
            cuts = np.concatenate([[0], np.searchsorted(t_i, inside - ONE_INSTANT), [len(t_i) - 1]])
            high, low = extremes(t_i, y_i, POINTS, cuts)
            self._max.append(high)
            self._min.append(low)
            start = end
        self._t, self._y = self._t[start:], self._y[start:]

    def result(self) -> tuple[Array, Array]:
        """(y_max, y_min) of the completed intervals, shapes (K, n_y)."""
        shape = (len(self._max), self._y.shape[1])
        return np.array(self._max).reshape(shape), np.array(self._min).reshape(shape)
