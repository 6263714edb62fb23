"""When the closed loop steps, records and stops."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from icmj.base.array import Array
from icmj.base.instants import ONE_INSTANT
from icmj.controller.law import Law
from icmj.plant.linear_plant import LinearPlant


def compute_rates(plant: LinearPlant, controller: Law) -> np.ndarray:
    """Eigenvalues λ of plant and controller between events, of all modes, as if nothing were delayed [1/s]."""
    controls = controller.realisation
    found = []
    for mode in controls.modes:
        read = controls.read(plant.C, mode)
        closed = np.block([[plant.A, -plant.B @ mode.K], [np.zeros((len(mode.M), plant.n)), mode.M]])
        closed += np.vstack([-plant.B @ mode.S[:, : len(read)], mode.N[:, : len(read)]]) @ read
        found.append(np.linalg.eigvals(closed))
    return np.concatenate(found)


def find_fastest_rate(plant: LinearPlant, controller: Law) -> float:
    """Largest |λ| of plant and controller between events, in any mode, as if nothing were delayed [rad/s]."""
    return float(np.abs(compute_rates(plant, controller)).max())


EVENT_TOLERANCE = 1e-13  # s; event times are located by Newton until a correction is smaller than this

NO_END = 2**62


@dataclass(frozen=True, eq=False)
class Schedule:
    """Times of one run.

    Attributes:
        timestep: h [s].
        t_end: where the run ends [s].
        edges: times at which the disturbance may jump [s], rising; steps end on them.
        phases: a time within each stretch between edges, shape (len(edges) + 1,).
        record_interval: rows are at its multiples, of a timestep that is given at the first that ends there or later,
            and at events, actions, ``breaks`` and the end [s].
        limits: the run has fallen when a position departs further than its own [rad or m], shape (nv,).
        rate: fastest rate |λ| of the linear closed loop [rad/s]; bounds how far E(t) can leave its Hermite cubic.
        events: number of events after which to stop.
        tolerance: relative error of an open-loop interval that the timestep is chosen for; 0 where it is given. Rows
            are then by steps of their own where they are due.
        breaks: edges at which the motion jumps or bends, and instants at which the controller reads that [s], rising.
    """

    timestep: float
    t_end: float
    edges: Array
    phases: Array
    record_interval: float
    limits: Array
    rate: float
    events: int = NO_END
    tolerance: float = 0.0
    breaks: Array = field(default_factory=lambda: np.zeros(0))

    def first_edge(self, t: float) -> int:
        """Index of the first edge after ``t``, which is also that of the stretch around ``t``."""
        return int(np.searchsorted(self.edges, t, side="right"))


def find_next_row(t: float, interval: float, breaks: Array) -> float:
    """When the first row after ``t`` is due [s]: at a multiple of ``interval`` or a break, of which the last is inf.

    Where ``t`` is one itself, but for rounding, it is the next.
    """
    return float(
        min(
            (np.floor(t / interval + 1e-8) + 1) * interval,
            breaks[np.searchsorted(breaks, t + ONE_INSTANT, side="right")],
        )
    )


def choose_phases(edges: Array) -> Array:
    """A time ≥ 0 strictly within each stretch between ``edges``."""
    if len(edges) == 0:
        return np.zeros(1)
    return np.concatenate([[edges[0] / 2], (edges[1:] + edges[:-1]) / 2, [edges[-1] + 1]])
