"""A closed loop laid out for the compiled simulation, and what comes of it: the whole run, or one interval.

It takes every loop that nothing disturbs and whose events are one at a time under way; the others go piece by piece
(:mod:`icmj.linear.flight`), which also is what the compiled code is tested against.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers
from icmj.controller.delay import predictor
from icmj.linear.flight import Stage
from icmj.linear.history import Collected
from icmj.linear.native.state import COUNTS, FACTS, FRESH, NOW, Count, Fact, Now, Size, Status
from icmj.linear.propagator import exponential
from icmj.linear.watch import Watch
from icmj.simulation import ending
from icmj.simulation.ending import EventPace, Outcome

_COARSE = 7  # degree of the polynomials that dismiss a span
_TURN = 1.6  # the loop's fastest eigenvalue times a span: what so short polynomials can bound
_LONGEST = 8  # steps of a span
_ROWS, _EVENTS = 4096, 512  # of the buffers


def suits(stage: Stage) -> bool:
    """Whether the compiled simulation can take this loop."""
    controller = stage.loop.controller
    quiet = len(stage.stretches) == 1 and not len(stage.stretches[0][0].omega)
    return quiet and controller.delay.in_flight(controller.trigger.clock) <= 1


class Passage:
    """The numbers that the compiled simulation of one loop works on.

    Attributes:
        stage: the loop it is of.
        rows_t, rows_z: buffer of rows: times [s] and states z, shapes (R,) and (R, m).
        events: buffer of events: time [s], z before the reset, largest and smallest outputs since the last one.
    """

    def __init__(self, stage: Stage, interval: float = np.inf) -> None:
        """Lay out ``stage``, to be recorded every ``interval`` seconds, or not at all."""
        from icmj.base.compilation import called
        from icmj.linear.native.march import march

        self.stage, self._march, self._call = stage, march(), called
        loop, watch = stage.loop, stage.stretches[0][1]
        controller, h = loop.controller, watch.propagator.h
        self._sizes, self._plan = _plan(stage, watch, interval)
        self._cuts = loop.faces.cuts.astype(np.int64)
        m, rows = len(loop.M), int(self._sizes[Size.STEPS] * h / interval) + 8
        self._m, self._n_y, self._grid = m, loop.plant.n_y, (h, watch.propagator.degree)
        self._now = np.zeros(NOW + 2 * m + loop.n_hat + 2 * self._n_y)
        self._counts = np.zeros(COUNTS, dtype=np.int64)
        several = _EVENTS if np.isfinite(interval) else 1
        self.events = np.empty((several, 1 + m + 2 * self._n_y))
        capacity = max(_ROWS, 2 * rows) if np.isfinite(interval) else 8
        self.rows_t, self.rows_z = np.empty(capacity), np.empty((capacity, m))
        self._clock, self._delayed = controller.trigger.clock, bool(controller.delay)

    @property
    def t(self) -> float:
        """Where it is now [s]."""
        return float(self._now[Now.TIME])

    @property
    def z(self) -> Array:
        """z there, shape (m,); not to be kept."""
        return self._now[NOW : NOW + self._m]

    def begin(self, z: Array, t: float) -> None:
        """Start from ``z`` right after an event at ``t``."""
        now, m = self._now, self._m
        plan, controller = self._plan, self.stage.loop.controller
        now[:NOW] = t, t + controller.least, np.inf, np.inf, t
        if np.isfinite(self._clock):
            now[Now.TICK] = (np.floor(t / self._clock * (1 + 1e-12)) + 1) * self._clock
        now[NOW : NOW + m] = z
        if self._delayed:
            # the event at the start makes a prediction like any other
            n_hat = self.stage.loop.n_hat
            now[NOW + 2 * m : NOW + 2 * m + n_hat] = plan[-m * n_hat :].reshape(n_hat, m) @ z
            now[Now.ACTION] = _action(t, controller.delay.t_d, self._clock)
        y = self.stage.loop.plant.C @ self.stage.loop.x(z)
        now[-2 * self._n_y :] = np.concatenate([y, y])
        self._counts[:] = 0
        self._counts[Count.NEXT], self._counts[Count.AGE] = 1, FRESH

    def run(self, z: Array, progress: Callable[[float], None] | None = None) -> tuple[Collected, Outcome]:
        """The whole run from ``z`` at 0, which is an event; interrupted, it keeps what it has."""
        duration, pace = self.stage.duration, EventPace(self.stage.duration)
        rows: list[tuple[Array, Array]] = [(np.zeros(1), z[None, :].copy())]
        events: list[Array] = [self.events[:0].copy()]
        self.begin(z, 0.0)
        outcome = None
        try:
            while outcome is None:
                # who follows the run hears of every event
                status, n_rows, n_events = self.advance(1 << 40 if progress is None else 1)
                rows.append((self.rows_t[:n_rows].copy(), self.rows_z[:n_rows].copy()))
                events.append(self.events[:n_events].copy())
                if progress is not None:
                    progress(self.t / duration)
                if status is Status.ENDED:
                    least = self.stage.loop.controller.least
                    outcome = ending.ran(duration, np.diff(np.concatenate(events)[:, 0], prepend=0.0), least)
                elif status in (Status.FELL, Status.DIVERGED):
                    outcome = self.outcome(status)
                elif (took := pace.stalled(*events[-1][:, 0])) is not None:
                    outcome = ending.stalled(self.t, took)
        except KeyboardInterrupt:
            if self.t == 0:  # there is nothing to keep; it may have been compiling
                raise
            outcome = ending.interrupted(self.t, duration)
        if self.t > self._now[Now.ROW]:
            rows.append((np.array([self.t]), self.z[None, :].copy()))
        t, Z = (np.concatenate(parts) for parts in zip(*rows, strict=True))
        return Collected(t, Z, *self._parted(np.concatenate(events)), self._grid), outcome

    def outcome(self, status: Status) -> Outcome:
        """What it means that it ended so, where it is now; for a fall and for divergence."""
        return self.stage.outcome("fell" if status is Status.FELL else "diverged", self.z, self.t)

    def _parted(self, events: Array) -> tuple[Array, Array, Array, Array]:
        m, n_y = self._m, self._n_y
        return events[:, 0], events[:, 1 : 1 + m], events[:, 1 + m : 1 + m + n_y], events[:, 1 + m + n_y :]

    def advance(self, events: int = 1 << 40) -> tuple[Status, int, int]:
        """Go on for a while, to so many events at most; why it stopped, and how many rows and events it recorded."""
        counts = self._counts
        counts[Count.ROWS] = counts[Count.EVENTS] = 0
        buffers = self.rows_t, self.rows_z, self.events
        status = self._call(self._march, self._sizes, self._cuts, self._plan, self._now, counts, *buffers, events)
        return Status(status), int(counts[Count.ROWS]), int(counts[Count.EVENTS])

    def last_event(self) -> tuple[float, Array, Array, Array]:
        """Of the last event recorded: its time [s], z before the reset, largest and smallest outputs until then."""
        t, z, high, low = self._parted(self.events[int(self._counts[Count.EVENTS]) - 1 :][:1].copy())
        return float(t[0]), z[0], high[0], low[0]


def _action(t: float, delay: float, clock: float) -> float:
    at = t + delay
    if np.isfinite(clock) and abs(at / clock - round(at / clock)) < 1e-9:
        return float(round(at / clock) * clock)
    return at


def _plan(stage: Stage, watch: Watch, interval: float) -> tuple[np.ndarray, Array]:
    """Sizes and numbers, in the order of :mod:`icmj.linear.native.march`."""
    loop, flow = stage.loop, watch.propagator
    controller, M, h, degree = loop.controller, loop.M, flow.h, flow.degree
    fastest = float(np.abs(np.linalg.eigvals(M)).max(initial=0.0)) * h
    q = int(np.clip(_TURN / max(fastest, 1e-300), 1, _LONGEST))
    rows, r, n_pos = watch.rows, len(loop.faces.R), len(loop.positions)
    faces, positions, outputs = np.split(rows, [r, r + n_pos])
    curves = np.vstack([faces, outputs])
    # c (M H)^j / j! of every row, until nothing is left
    G, terms, small, total = M * (q * h), [np.vstack([curves, positions])], 0, np.abs(np.vstack([curves, positions]))
    while small < 2:
        terms.append(terms[-1] @ G / len(terms))
        small = small + 1 if np.all(np.abs(terms[-1]) <= 1e-18 * total) and len(terms) > _COARSE else 0
        total = total + np.abs(terms[-1])
    series = np.array(terms)
    short = series[: _COARSE + 1, : len(curves)]
    controls = np.einsum("ij,jrm->rim", from_powers(_COARSE), short).reshape(-1, len(M))
    left = np.abs(series[_COARSE + 1 :])
    order = np.arange(_COARSE + 1, len(series), dtype=float)
    bounds = np.vstack(
        [
            left[:, :r].sum(axis=0),
            np.einsum("j,jrm->rm", order, left[:, r : len(curves)]),
            np.abs(series[1:, len(curves) :]).sum(axis=0),
        ]
    )
    known = np.block([[loop.T_hat, np.eye(loop.n_hat), np.zeros((loop.n_hat, loop.n_hat))]])
    foreseen = np.zeros_like(known)
    if controller.delay:
        hold = known.copy()
        hold[:, -loop.n_hat :] = np.eye(loop.n_hat)
        E_p = predictor(controller.design, controller.hold, controller.delay.predicted)
        foreseen = E_p @ np.vstack([known, hold])
    facts = np.zeros(FACTS)
    facts[Fact.STEP], facts[Fact.END], facts[Fact.INTERVAL] = h, stage.duration, interval
    facts[Fact.CLOCK], facts[Fact.LEAST] = controller.trigger.clock, controller.least
    facts[Fact.DELAY] = controller.delay.t_d
    row_step = exponential(M * interval) if np.isfinite(interval) else np.zeros_like(M)
    matrices = (
        exponential(M * h),
        (M * h),
        row_step,
        np.vstack([exponential(G), controls, positions]),
        bounds,
        np.moveaxis(flow.powers_of(rows), 0, 1),
        from_powers(degree),
        from_powers(2 * degree),
        known,
        foreseen,
    )
    sizes = np.zeros(len(Size), dtype=np.int64)
    for size, value in {
        Size.STATES: len(M),
        Size.PLANT: loop.n,
        Size.MODEL: loop.n_hat,
        Size.FACE_ROWS: r,
        Size.FACES: len(loop.faces),
        Size.POSITIONS: n_pos,
        Size.OUTPUTS: len(outputs),
        Size.DEGREE: degree,
        Size.COARSE: _COARSE,
        Size.STEPS: q,
        Size.DELAYED: bool(controller.delay),
    }.items():
        sizes[size] = value
    return sizes, np.concatenate(list(chain([facts], (np.ravel(matrix) for matrix in matrices))))
