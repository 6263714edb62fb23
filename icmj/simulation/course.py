"""The course of one open-loop interval: its states at any time, and the variational equation along it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from icmj.base.array import Array


@dataclass(frozen=True, eq=False)
class Sample:
    """An interval at some of its times, departures from the operating point.

    Attributes:
        t: since the event that begins it [s], shape (K,).
        x, x_o, x_h: shapes (K, n), (K, n̂), (K, n̂).
        y, u: outputs and commands, shapes (K, n_y), (K, n_u).
        qpos: MuJoCo's positions, shape (K, nq); (K, 0) on the linear plant.
    """

    t: Array
    x: Array
    x_o: Array
    x_h: Array
    y: Array
    u: Array
    qpos: Array


class Course(Protocol):
    """A simulated open-loop interval.

    Attributes:
        cuts: ends of its smooth parts [s], rising from 0 to its length.
        rate: dw/dt at its end, shape (n + N_a,).
    """

    cuts: tuple[float, ...]
    rate: Array

    def sample(self, t: Array) -> Sample:
        """The trajectory at increasing times within the interval [s], shape (K,)."""

    def generators(self, t: Array, part: int) -> Array:
        """F(t) of δẇ = F δw at times within a part [s]; shape (K, n + N_a, n + N_a)."""
