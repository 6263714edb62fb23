"""What a loop writes while it runs: preallocated buffers, filled from the start in every chunk of steps."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from icmj.linear_plant import Array


class Status(IntEnum):
    """Why a loop returned."""

    RUNNING = 0
    COMPLETED = 1
    FELL = 2
    DIVERGED = 3
    WARNED = 4


@dataclass(frozen=True, eq=False)
class Recording:
    """Buffers for one chunk of at most N steps.

    Attributes:
        dense: time and outputs at the end of every step, shape (N, 1 + n_y).
        samples: decimated rows (t, qpos, qvel, act, sensordata), shape (N, width).
        events: the same rows at the events, before the reset, shape (N, width).
        event_at: index of each event's row in ``dense``, shape (N,).
        count: rows filled in dense, samples, events; shape (3,).
    """

    dense: Array
    samples: Array
    events: Array
    event_at: np.ndarray
    count: np.ndarray

    def clear(self) -> None:
        """Start a new chunk."""
        self.count[:] = 0


def recording(steps: int, n_y: int, width: int) -> Recording:
    """Buffers for ``steps`` steps."""
    return Recording(
        np.empty((steps, 1 + n_y)),
        np.empty((steps, width)),
        np.empty((steps, width)),
        np.zeros(steps, dtype=np.int64),
        np.zeros(3, dtype=np.int64),
    )
