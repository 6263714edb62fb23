"""What a simulation collects while it runs: recorded samples and events."""

from __future__ import annotations

import numpy as np

from icmj.controller import ClockTrigger, Continuous, EventTrigger
from icmj.linear.closed_loop import ClosedLoop
from icmj.linear.watch import Piece, Watch
from icmj.linear_plant import Array
from icmj.simulation import Events, Outcome, Simulation

_SAME = 1e-12  # a recording instant this close to an event [s] is the event


class History:
    """Samples of z at multiples of ``interval`` and at events, and the events themselves.

    Attributes:
        t, z: where the run is now; z = (x, d, e).
        last_sample: time of the controller's last sample [s].
        samples: number of samples after the one at t = 0.
    """

    def __init__(self, loop: ClosedLoop, interval: float, z: Array) -> None:
        self.loop, self.interval = loop, interval
        self.t, self.z = 0.0, z
        self.last_sample, self.samples = 0.0, 0
        self._recorded: list[tuple[Array, Array]] = [(np.zeros(1), z[None, :])]
        self._next = 1
        self._flow: tuple[float, int] = (0.0, 0)
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
            position = (times - self.t) / watch.flow.h
            step = np.clip(position.astype(int), 0, len(piece.Z) - 1)
            Z = watch.flow.within(piece.Z[step], position - step)[:, :size]
            self._recorded.append((times, Z))
        self._next = max(self._next, last + 1)
        self._flow = (watch.flow.h, watch.flow.degree)
        self.t, self.z = end, piece.z[:size]
        self._y_max = np.maximum(self._y_max, piece.y_max)
        self._y_min = np.minimum(self._y_min, piece.y_min)

    def sample(self) -> None:
        """The controller samples now: an event is noted and x_h := x_o."""
        self._record_now()
        self._events.append((self.t, self.z, self._y_max, self._y_min))
        self.z = self.z.copy()
        self.loop.e(self.z)[:] = 0
        self.last_sample, self.samples = self.t, self.samples + 1
        self._reset_extremes()

    def intervals(self) -> Array:
        """Intervals between samples so far [s], shape (samples,)."""
        return np.diff([0.0, *(event[0] for event in self._events)])

    def _record_now(self) -> None:
        if self.t > self._recorded[-1][0][-1]:
            self._recorded.append((np.array([self.t]), self.z[None, :]))
        if abs(self._next * self.interval - self.t) <= _SAME:
            self._next += 1

    def simulation(self, outcome: Outcome) -> Simulation:
        """Everything collected, as data."""
        loop, trigger = self.loop, self.loop.controller.trigger
        self._record_now()
        t = np.concatenate([times for times, _ in self._recorded])
        Z = np.vstack([states for _, states in self._recorded])
        E = np.full(len(t), np.nan)
        if isinstance(trigger, EventTrigger):
            e = loop.e(Z)
            E = np.einsum("ni,ij,nj->n", e, trigger.Q_t, e) - trigger.q_t**2
        control = "clock" if isinstance(trigger, ClockTrigger) else "event"
        step, degree = self._flow
        return Simulation(
            plant="linear",
            control="continuous" if isinstance(trigger, Continuous) else control,  # type: ignore[arg-type]
            t=t,
            x=loop.x(Z),
            y=loop.x(Z) @ loop.plant.C.T,
            u=-loop.x_h(Z) @ loop.controller.design.k.T,
            x_o=loop.x_o(Z),
            x_h=loop.x_h(Z),
            E=E,
            events=self._event_data(),
            outcome=outcome,
            precision={
                "integrator": "matrix exponential",
                "order": "exact",
                "event_tolerance": 1e-12,
                "step": step,
                "series_terms": degree + 1,
            },
        )

    def _event_data(self) -> Events:
        loop = self.loop
        Z = np.array([event[1] for event in self._events]).reshape(-1, len(self.z))
        n_y = loop.plant.n_y
        return Events(
            t=np.array([event[0] for event in self._events], dtype=float),
            x=loop.x(Z),
            x_o=loop.x_o(Z),
            x_h=loop.x_h(Z),
            y_max=np.array([event[2] for event in self._events]).reshape(-1, n_y),
            y_min=np.array([event[3] for event in self._events]).reshape(-1, n_y),
        )
