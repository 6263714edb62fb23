"""The preallocated buffers of a run's record, filled from the beginning in every chunk of steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array


class Buffers(NamedTuple):
    """Buffers for one chunk of at most N steps; a named tuple, which compiled code takes.

    Attributes:
        dense: time and outputs at the end of every step, shape (N, 1 + n_y).
        rows: decimated rows (t, qpos, qvel, act, sensordata), shape (N, width).
        events: the same rows at the events, before the reset, shape (N, width).
        event_at: index of each event's row in ``dense``, shape (N,).
        u, mode: command and mode at the rows, shapes (N, n_u), (N,); not of a run by steps.
        rough: instants at which something is not smooth, shape (2 N,).
        count: filled in dense, rows, events; steps taken; instants in rough, and rows with a command; shape (6,).
    """

    dense: Array
    rows: Array
    events: Array
    event_at: np.ndarray
    u: Array
    mode: np.ndarray
    rough: Array
    count: np.ndarray  # type: ignore[assignment]

    def clear(self) -> None:
        """Start a new chunk."""
        self.count[:] = 0


def make_buffers(steps: int, n_y: int, width: int, n_u: int) -> Buffers:
    """Buffers for ``steps`` steps or samples."""
    return Buffers(
        np.empty((steps, 1 + n_y)),
        np.empty((steps, width)),
        np.empty((steps, width)),
        np.zeros(steps, dtype=np.int64),
        np.zeros((steps, n_u)),
        np.zeros(steps, dtype=np.int64),
        np.zeros(2 * steps),
        np.zeros(6, dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class States:
    """Rows as departures from the operating point, shapes (N, ...)."""

    x: Array
    x_o: Array
    x_h: Array
    y: Array
