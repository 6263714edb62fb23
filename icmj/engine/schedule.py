"""When the closed loop steps, acts, records and stops: everything a loop needs besides the model; and its record.

The record is preallocated buffers, filled from the beginning in every chunk of steps.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.base.roots import ONE_INSTANT
from icmj.controller.controller import Law
from icmj.plant.linear_plant import LinearPlant


def rates_of(plant: LinearPlant, controller: Law) -> np.ndarray:
    """Eigenvalues λ of plant and controller between events, of all modes, as if nothing were delayed [1/s]."""
    controls = controller.realisation
    found = []
    for mode in controls.modes:
        read = controls.read(plant.C, mode)
        closed = np.block([[plant.A, -plant.B @ mode.K], [np.zeros((len(mode.M), plant.n)), mode.M]])
        closed += np.vstack([-plant.B @ mode.S[:, : len(read)], mode.N[:, : len(read)]]) @ read
        found.append(np.linalg.eigvals(closed))
    return np.concatenate(found)


def fastest_rate(plant: LinearPlant, controller: Law) -> float:
    """Largest |λ| of plant and controller between events, in any mode, as if nothing were delayed [rad/s]."""
    return float(np.abs(rates_of(plant, controller)).max())


EVENT_TOLERANCE = 1e-13  # s; event times are located by Newton until a correction is smaller than this

NO_END = 2**62


@dataclass(frozen=True, eq=False)
class Schedule:
    """Times of one run.

    Attributes:
        timestep: h [s].
        t_end: where the run ends [s].
        delta_min: Δ_min of the event trigger, counted from the event [s].
        clock: interval of the clock trigger [s]; infinite for others.
        delay: t_d from an event to its action [s].
        edges: times at which the disturbance may jump [s], rising; steps end on them.
        phases: a time within each stretch between edges, shape (len(edges) + 1,).
        record_interval: rows are at its multiples, of a timestep that is given at the first that ends there or later,
            and at events, actions, ``breaks`` and the end [s].
        limits: the run has fallen when a position departs further than its own [rad or m], shape (nv,).
        rate: fastest rate |λ| of the linear closed loop [rad/s]; bounds how far E(t) can leave its Hermite cubic.
        events: number of events after which to stop.
        tolerance: relative error of an open-loop interval that the timestep is chosen for; 0 where it is given. Rows
            are then by steps of their own where they are due.
        sampling: d_s from when the event rule reaches its threshold to the event [s].
        breaks: edges at which the motion jumps or bends, and instants at which the controller reads that [s], rising.
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
    sampling: float = 0.0
    breaks: Array = field(default_factory=lambda: np.zeros(0))

    def clock_action(self, number: int) -> float:
        """Time of the action of this event of the clock [s]; a tick if the delay is a multiple of its interval."""
        ticks = self.delay / self.clock
        if abs(ticks - round(ticks)) < RELATIVE_ROUNDING * ticks:
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


def row_after(t: float, interval: float, breaks: Array) -> float:
    """When the first row after ``t`` is due [s]: at a multiple of ``interval`` or a break, of which the last is inf.

    Where ``t`` is one itself, but for rounding, it is the next.
    """
    return float(
        min(
            (np.floor(t / interval + 1e-8) + 1) * interval,
            breaks[np.searchsorted(breaks, t + ONE_INSTANT, side="right")],
        )
    )


def phases_of(edges: Array) -> Array:
    """A time ≥ 0 strictly within each stretch between ``edges``."""
    if len(edges) == 0:
        return np.zeros(1)
    return np.concatenate([[edges[0] / 2], (edges[1:] + edges[:-1]) / 2, [edges[-1] + 1]])


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
