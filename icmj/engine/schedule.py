"""When the closed loop steps, acts, records and stops: everything a loop needs besides the model; and its record.

The record is preallocated buffers, filled from the beginning in every chunk of steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.controller.delay import SAME
from icmj.engine.tableau import Tableau, method_for

EVENT_TOLERANCE = 1e-13  # s; event times are located by Newton until a correction is smaller than this

NO_END = 2**62


@dataclass(frozen=True, eq=False)
class Schedule:
    """Times of one run.

    Attributes:
        timestep: h [s]; of adaptive steps a length to begin with.
        t_end: where the run ends [s].
        delta_min: Δ_min of the event trigger, counted from the event [s].
        clock: interval of the clock trigger [s]; infinite for others.
        delay: t_d from an event to its action [s].
        edges: times at which the disturbance may jump [s], rising; steps end on them.
        phases: a time within each stretch between edges, shape (len(edges) + 1,).
        record_interval: rows are at its multiples, of fixed steps at the first that ends there or later, and at events,
            actions and the end [s].
        limits: the run has fallen when a position departs further than its own [rad or m], shape (nv,).
        rate: fastest rate |λ| of the linear closed loop [rad/s]; bounds how far E(t) can leave its Hermite cubic.
        events: number of events after which to stop.
        tolerance: relative error of an open-loop interval that adaptive steps keep to; 0 where the timestep is given.
        stiff: whether the loop's fast modes, rather than accuracy, would bound long steps.
        sampling: d_s from when the event rule reaches its threshold to the event [s].
    """

    timestep: float
    t_end: float
    delta_min: float
    clock: float
    delay: float
    edges: Array
    phases: Array
    record_interval: float
    limits: Array
    rate: float
    events: int = NO_END
    tolerance: float = 0.0
    stiff: bool = False
    sampling: float = 0.0

    @property
    def method(self) -> Tableau:
        """The Runge–Kutta method of adaptive steps."""
        return method_for(self.tolerance, self.stiff)

    @property
    def first_step(self) -> float:
        """Length of the first adaptive step [s]; 0 for a fixed timestep."""
        if not self.tolerance:
            return 0.0
        return float(self.tolerance ** (1 / self.method.order) / self.rate)

    def clock_action(self, number: int) -> float:
        """Time of the action of this event of the clock [s]; a tick if the delay is a multiple of its interval."""
        ticks = self.delay / self.clock
        if abs(ticks - round(ticks)) < SAME * ticks:
            return (number + round(ticks)) * self.clock
        return number * self.clock + self.delay

    def jumps(self, start: float, end: float) -> Array:
        """Times strictly between two successive events at which inputs jump: edges and actions, rising."""
        first = int(np.searchsorted(self.edges, start, side="right"))
        inside = self.edges[first : max(first, int(np.searchsorted(self.edges, end)))]
        if self.delay == 0:
            return inside
        if np.isfinite(self.clock):
            first, last = int((start - self.delay) / self.clock) - 1, int(end / self.clock) + 1
            acts = np.array([self.clock_action(number) for number in range(max(first, 0), last)])
        else:
            acts = np.array([start + self.delay])
        return np.union1d(inside, acts[(acts > start) & (acts < end)])

    def first_edge(self, t: float) -> int:
        """Index of the first edge after ``t``, which is also that of the stretch around ``t``."""
        return int(np.searchsorted(self.edges, t, side="right"))

    def first_clock(self, t: float) -> int:
        """Number of the first event of the clock after ``t``."""
        return int(np.floor(t / self.clock * (1 + 1e-12))) + 1


def row_after(t: float, interval: float) -> float:
    """The first multiple of the interval between rows after ``t`` [s], which may be one itself, but for rounding."""
    return float((np.floor(t / interval + 1e-8) + 1) * interval)


def phases_of(edges: Array) -> Array:
    """A time ≥ 0 strictly within each stretch between ``edges``."""
    if len(edges) == 0:
        return np.zeros(1)
    return np.concatenate([[edges[0] / 2], (edges[1:] + edges[:-1]) / 2, [edges[-1] + 1]])


class Status(IntEnum):
    """Why a loop returned."""

    RUNNING = 0
    COMPLETED = 1
    FELL = 2
    DIVERGED = 3
    WARNED = 4
    REACHED = 5  # as many events as were asked for
    COLLAPSED = 6  # no step was short enough for the tolerance


class Recording(NamedTuple):
    """Buffers for one chunk of at most N steps; a named tuple, which compiled code takes.

    Attributes:
        dense: time and outputs at the end of every step, shape (N, 1 + n_y).
        rows: decimated rows (t, qpos, qvel, act, sensordata), shape (N, width).
        events: the same rows at the events, before the reset, shape (N, width).
        event_at: index of each event's row in ``dense``, shape (N,).
        count: rows filled in dense, rows, events; and steps taken; shape (4,).
    """

    dense: Array
    rows: Array
    events: Array
    event_at: np.ndarray
    count: np.ndarray  # type: ignore[assignment]

    def clear(self) -> None:
        """Start a new chunk."""
        self.count[:] = 0


def recording(steps: int, n_y: int, width: int) -> Recording:
    """Buffers for ``steps`` steps or samples."""
    return Recording(
        np.empty((steps, 1 + n_y)),
        np.empty((steps, width)),
        np.empty((steps, width)),
        np.zeros(steps, dtype=np.int64),
        np.zeros(4, dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class States:
    """Rows as departures from the operating point, shapes (N, ...)."""

    x: Array
    x_o: Array
    x_h: Array
    y: Array
