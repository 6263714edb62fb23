"""A closed loop prepared for the compiled simulation, and the result of a whole run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.base.interruption import defer_interrupt
from icmj.controller.controller import Controller
from icmj.linear.loop import LinearLoop, find_positions, make_forcing, make_linear_loop
from icmj.linear.native.motion import FRESH, Acting, Count, Now, Run, Tables
from icmj.linear.response import Response
from icmj.linear.tables import make_tables
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation import ending, position_limit
from icmj.simulation.disturbance import Disturbance, Pushes, make_acting
from icmj.simulation.ending import EventPace, Outcome
from icmj.simulation.native.loop import ACTED, EDGE, PLANNED, TICK, Status
from icmj.simulation.settings import Settings

_ROWS, _EVENTS = 8192, 512  # of the buffers


@dataclass(frozen=True, eq=False)
class Collection:
    """The result of a run, in z = (x, d, e).

    Attributes:
        t, Z: rows, shapes (N,) and (N, m).
        event_t, event_Z: events and z just before their resets, shapes (K,) and (K, m).
        y_max, y_min: extremes of the outputs over the intervals that they end, shape (K, n_y).
    """

    t: Array
    Z: Array
    event_t: Array
    event_Z: Array
    y_max: Array
    y_min: Array


@dataclass(frozen=True, eq=False)
class RunEnd:
    """How a run ends: of ``plant``, the ``limits`` of whose positions are in their order, after ``duration`` [s]."""

    plant: LinearPlant
    limits: Array
    duration: float

    def tell(self, status: Status, t: float, x: Array) -> Outcome:
        """The outcome for a return code at the state ``x``, or what begins with it: all but those of a complete run."""
        if status == Status.FELL:
            positions = find_positions(self.plant)
            at = int(np.argmax(np.abs(x[positions]) / self.limits))
            state = positions[at]
            return ending.end_fallen(t, self.plant.states[state], self.limits[at], self.plant.state_units[state])
        return ending.end_stalled(t) if status == Status.STALLED else ending.end_diverged(t, "a state exceeded 1e+12")

    def pursue(
        self,
        advance: Callable[[], int],
        keep: Callable[[bool], Array],
        now: Callable[[], tuple[float, Array]],
        least: float,
        progress: Callable[[float], None] | None,
    ) -> Outcome:
        """``advance`` until the run ends; returns how it did. An interrupted run keeps its results so far.

        ``keep`` stores what was recorded since its last call, which may be the last, and returns the times of its
        events [s]; ``now`` tells the time and the state. The ``least`` interval is the controller's [s].
        """
        pace, times = EventPace(self.duration), [np.zeros(1)]
        try:
            while True:
                status = advance()
                times.append(keep(status == Status.COMPLETED))
                if progress is not None:
                    progress(now()[0] / self.duration)
                if status == Status.COMPLETED:
                    return ending.end_complete(self.duration, np.diff(np.concatenate(times)), least)
                if status in (Status.FELL, Status.DIVERGED, Status.STALLED):
                    return self.tell(Status(status), *now())
                if (took := pace.stalled(*times[-1])) is not None:
                    return ending.end_stalled(now()[0], took)
        except KeyboardInterrupt:
            keep(False)
            if now()[0] == 0:  # there is nothing to keep; it may have been compiling
                raise
            return ending.end_interrupted(now()[0], self.duration)


class Simulator:
    """The compiled simulation of one loop, with its buffers; not for two threads at once.

    Attributes:
        loop: the closed loop.
        disturbance: beside the plant's commands.
        pushes: on the plant itself.
        tables: the numbers that stay.
        end: how a run ends.
    """

    loop: LinearLoop
    disturbance: Disturbance
    pushes: Pushes
    tables: Tables
    end: RunEnd

    def __init__(
        self, plant: LinearPlant, controller: Controller, settings: Settings, interval: float = np.inf
    ) -> None:
        """Prepare runs of ``plant`` under ``controller``, recorded every ``interval`` seconds, or not at all.

        Raises:
            SimulationError: if plant and controller do not fit, or a disturbance or a limit names what the plant does
                not have.
        """
        from icmj.base.compilation import call
        from icmj.linear.native.pieces import compile_pieces

        self._simulate, self._call = compile_pieces(), call
        self.disturbance, _, self.pushes = parts = make_acting(plant, settings, controller)
        shares = self.disturbance.shares
        self.loop = loop = make_linear_loop(plant, controller, [index for index, _ in shares])
        acting = make_forcing(loop, *parts)
        names, units = (tuple(of[i] for i in loop.positions) for of in (plant.states, plant.state_units))
        limits, duration = position_limit.get_limits(settings.limit, names, units), float(settings.duration)
        self.end = RunEnd(plant, limits, duration)
        self.tables = T = make_tables(loop, acting, duration, limits, interval, [of for _, of in shares])
        self._response = Response(T, acting)
        m, n_y, rows = loop.moving, plant.n_y, int(min(T.step / interval, 1e9)) + 8
        self._m, self._n_y, several = m, n_y, np.isfinite(interval)
        self._capacity = capacity = max(_ROWS, 2 * rows) if several else 8
        self._run = Run(
            now=np.zeros(len(Now)), counts=np.zeros(len(Count), np.int64), when=np.zeros(3), due=np.zeros(6, np.int64),
            queue=np.zeros(int(T.delay / T.clock) + 4), w=np.zeros(len(T.J)),
            s=np.zeros(T.W.shape[1]), begun=np.zeros(m), ended=np.zeros(m), row=np.zeros(m),
            high=np.zeros(n_y), low=np.zeros(n_y), rows_t=np.empty(capacity), rows_z=np.empty((capacity, m)),
            events=np.empty((_EVENTS if several else 1, 1 + m + 2 * n_y)),
        )  # fmt: skip

    @property
    def t(self) -> float:
        """The present time [s]."""
        return float(self._run.now[Now.TIME])

    @property
    def z(self) -> Array:
        """The present z, shape (m,), as a view that the next step overwrites."""
        return self._run.s[: self._m] if self._run.counts[Count.CELL] >= 0 else self._run.w[: self._m]

    def begin(self, w: Array, t: float) -> None:
        """Start from ``w`` right after an event at ``t``."""
        run, T, counts, due = self._run, self.tables, self._run.counts, self._run.due
        run.w[:] = w
        run.now[:] = 0.0
        run.now[[Now.TIME, Now.ROW]] = t
        counts[:] = 0
        counts[Count.NEXT], counts[Count.AGE], counts[[Count.CELL, Count.ENDED]] = 1, FRESH, -1
        counts[Count.STRETCH] = np.searchsorted(T.points, t, side="right")
        # the event at the start makes a prediction like any other
        run.when[:] = t + T.wait, np.inf, t
        due[:] = 0
        due[EDGE] = np.searchsorted(T.edges, t, side="right")
        due[TICK] = int(np.floor(t / T.clock * (1 + 1e-12))) + 1
        if T.delay > 0:
            run.queue[0], due[[ACTED, PLANNED]] = t + T.delay, (0, 1)
        run.high[:] = run.low[:] = self.loop.plant.C @ self.loop.x(w)

    def run(self, w: Array, progress: Callable[[float], None] | None = None) -> tuple[Collection, Outcome]:
        """The whole run from ``w`` at t = 0, which is an event; an interrupted run keeps its results so far."""
        # a buffer that is large enough becomes the result, with room for a row at either end
        t, Z = np.empty(self._capacity + 2), np.empty((self._capacity + 2, self._m))
        self._run = self._run._replace(rows_t=t[1:-1], rows_z=Z[1:-1])
        rows: list[tuple[Array, Array]] = [(np.zeros(1), w[None, : self._m].copy())]
        events: list[Array] = [self._run.events[:0].copy()]
        self.begin(w, 0.0)

        def keep(last: bool) -> Array:
            """Store the rows recorded since the last call; returns the times of the events."""
            counts = self._run.counts
            with defer_interrupt():
                n_rows, n_events = counts[Count.ROWS], counts[Count.EVENTS]
                rows.append((self._run.rows_t[:n_rows], self._run.rows_z[:n_rows]))
                events.append(self._run.events[:n_events])
                if not last:  # the buffers are used again
                    rows[-1], events[-1] = (rows[-1][0].copy(), rows[-1][1].copy()), events[-1].copy()
                counts[Count.ROWS] = counts[Count.EVENTS] = 0
                return events[-1][:, 0]

        # who follows the run hears of every event
        at_once, least = 1 << 40 if progress is None else 1, self.loop.controller.least
        outcome = self.end.pursue(lambda: self.advance(at_once)[0], keep, lambda: (self.t, self.z), least, progress)
        if len(rows) == 2 and rows[1][0].base is t:
            until = 1 + len(rows[1][0])
            t[[0, until]], Z[0], Z[until] = (0.0, self.t), w[: self._m], self.z
            until += self.t > self._run.now[Now.ROW]
            t, Z = t[:until], Z[:until]
        else:
            if self.t > self._run.now[Now.ROW]:
                rows.append((np.array([self.t]), self.z[None, :].copy()))
            t, Z = (np.concatenate(parts) for parts in zip(*rows, strict=True))
        return Collection(t, Z, *self._split(np.concatenate(events))), outcome

    def advance(self, events: int = 1 << 40) -> tuple[Status, int, int]:
        """Continue for at most this number of events; returns why it stopped, and how many rows and events it has."""
        counts = self._run.counts
        counts[Count.ROWS] = counts[Count.EVENTS] = 0
        known = None
        while (acting := self._acting()) is not known:
            status = self._call(self._simulate, self.tables, acting, self._run, events)
            full = counts[Count.EVENTS] == len(self._run.events)  # what acts next may have changed at the same time
            if status != Status.RUNNING or full:
                break
            known = acting
        return Status(status), int(counts[Count.ROWS]), int(counts[Count.EVENTS])

    def _acting(self) -> Acting:
        """The exogenous inputs at the present time."""
        T, now, cell = self.tables, self._run.now, int(self._run.counts[Count.CELL])
        if not T.powers:
            return self._response.acting
        if cell < 0:  # where the step before is about to end, the compiled simulation comes back for the next
            cell = int(now[Now.TIME] / T.step)
        return self._response.reach(cell, float(T.edges[self._run.due[EDGE]]))

    def last_event(self) -> tuple[float, Array, Array, Array]:
        """Of the last event recorded: its time [s], z before the reset, largest and smallest outputs until then."""
        last = int(self._run.counts[Count.EVENTS]) - 1
        t, z, high, low = self._split(self._run.events[last : last + 1].copy())
        return float(t[0]), z[0], high[0], low[0]

    def _split(self, events: Array) -> tuple[Array, Array, Array, Array]:
        m, n_y = self._m, self._n_y
        return events[:, 0], events[:, 1 : 1 + m], events[:, 1 + m : 1 + m + n_y], events[:, 1 + m + n_y :]
