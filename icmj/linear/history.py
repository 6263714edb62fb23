"""What a simulation collects while it runs: rows and events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.linear.closed_loop import LinearLoop
from icmj.linear.watch import Piece, Watch
from icmj.simulation.ending import Outcome
from icmj.simulation.labels import labels_of
from icmj.simulation.simulation import Events, Simulation

_SAME = 1e-12  # a recording instant this close to an event [s] is the event


class History:
    """Rows of z at multiples of ``interval`` and at events, and the events themselves.

    Attributes:
        t, z: where the run is now; z = (x, d, e).
    """

    def __init__(self, loop: LinearLoop, interval: float, z: Array) -> None:
        self.loop, self.interval = loop, interval
        self.t, self.z = 0.0, z
        self._recorded: list[tuple[Array, Array]] = [(np.zeros(1), z[None, :])]
        self._next = 1
        self._grid: tuple[float, int] = (0.0, 0)
        self._events: list[tuple[float, Array, Array, Array]] = []
        self._reset_extremes()

    def _reset_extremes(self) -> None:
        y = self.loop.plant.C @ self.loop.x(self.z)
        self._y_max, self._y_min = y, y

    def append(self, watch: Watch, piece: Piece, end: float) -> None:
        """Add a piece that ends at ``end``: record it and move on to its end."""
        size = len(self.z)
        first, last = self._next, int(np.floor((end - _SAME) / self.interval))
        times: Array = np.arange(first, last + 1, dtype=float) * self.interval
        if len(times) > 0:
            position = (times - self.t) / watch.propagator.h
            step = np.clip(position.astype(int), 0, len(piece.Z) - 1)
            Z = watch.propagator.within(piece.Z[step], position - step)[:, :size]
            self._recorded.append((times, Z))
        self._next = max(self._next, last + 1)
        self._grid = (watch.propagator.h, watch.propagator.degree)
        self.t, self.z = end, piece.z[:size]
        self._y_max = np.maximum(self._y_max, piece.y_max)
        self._y_min = np.minimum(self._y_min, piece.y_min)

    def event(self) -> None:
        """The controller takes up feedback now: an event is noted and x_h := x_o."""
        self._record_now()
        self._events.append((self.t, self.z, self._y_max, self._y_min))
        if not self.loop.controller.delay:
            self.z = self.loop.reset(self.z)
        self._reset_extremes()

    def intervals(self) -> Array:
        """Open-loop intervals so far [s], shape (K,)."""
        return np.diff([0.0, *(event[0] for event in self._events)])

    def _record_now(self) -> None:
        if self.t > self._recorded[-1][0][-1]:
            self._recorded.append((np.array([self.t]), self.z[None, :]))
        if abs(self._next * self.interval - self.t) <= _SAME:
            self._next += 1

    def collected(self) -> Collected:
        """Everything collected, with a last row where the run is now."""
        self._record_now()
        t = np.concatenate([times for times, _ in self._recorded])
        Z = np.vstack([states for _, states in self._recorded])
        n_y, columns = self.loop.plant.n_y, zip(*self._events, strict=True)
        times, states, high, low = (np.array(values) for values in columns) if self._events else [np.zeros(0)] * 4
        return Collected(
            t, Z, times, states.reshape(-1, len(self.z)), high.reshape(-1, n_y), low.reshape(-1, n_y), self._grid
        )


@dataclass(frozen=True, eq=False)
class Collected:
    """What a run yields, in z = (x, d, e).

    Attributes:
        t, Z: rows, shapes (N,) and (N, m).
        event_t, event_Z: events and z just before their resets, shapes (K,) and (K, m).
        y_max, y_min: extremes of the outputs over the intervals that they end, shape (K, n_y).
        grid: step [s] and degree of its series.
    """

    t: Array
    Z: Array
    event_t: Array
    event_Z: Array
    y_max: Array
    y_min: Array
    grid: tuple[float, int]

    def simulation(self, loop: LinearLoop, outcome: Outcome, noisy: bool) -> Simulation:
        """As data that no longer know of z."""
        Z, (step, degree) = self.Z, self.grid
        x, x_o = loop.x(Z), loop.x_o(Z)
        x_h = x_o + loop.e(Z)
        return Simulation(
            plant="linear",
            control=loop.controller.trigger.kind,
            t=self.t,
            x=x,
            y=x @ loop.plant.C.T,
            u=-x_h @ loop.controller.design.k.T,
            x_o=x_o,
            x_h=x_h,
            E=loop.faces.E(loop.e(Z)),
            events=Events(
                t=self.event_t,
                x=loop.x(self.event_Z),
                x_o=loop.x_o(self.event_Z),
                x_h=loop.x_h(self.event_Z),
                y_max=self.y_max,
                y_min=self.y_min,
            ),
            outcome=outcome,
            precision={
                "integrator": "matrix exponential",
                "order": "exact",
                "event_tolerance": 1e-12,
                "step": step,
                "series_terms": degree + 1,
            },
            delay=loop.controller.delay.t_d,
            least=loop.controller.least,
            noisy=noisy,
            labels=labels_of(loop.plant, loop.controller.design.plant),
        )
