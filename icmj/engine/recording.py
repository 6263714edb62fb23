"""The record of a running loop: preallocated buffers, filled from the beginning in every chunk of steps."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array


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
