"""What a simulation yields, linear or MuJoCo: rows over time, events, and how it ended.

A *row* is an instant that is recorded; an *event* one at which the controller takes up new feedback.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from icmj.base.array import Array
from icmj.controller.trigger.trigger import Kind
from icmj.simulation.ending import Outcome
from icmj.simulation.pressure import Pressure


@dataclass(frozen=True, eq=False)
class Events:
    """The events t_i of the controller after the one at t = 0; K of them. Those of a clock count, too.

    Attributes:
        t: times [s], shape (K,).
        x, x_o, x_h: plant, observer and hold state just before the reset x_h := x_o, which a delay puts off;
            shapes (K, n), (K, n̂), (K, n̂).
        y_max, y_min: extremes of each output over the open-loop interval that ends here, shape (K, n_y).
    """

    t: Array
    x: Array
    x_o: Array
    x_h: Array
    y_max: Array
    y_min: Array

    @property
    def interval(self) -> Array:
        """Open-loop intervals Δ_i [s] that end at each event, shape (K,) (eq. Delta_i)."""
        return np.diff(self.t, prepend=0.0)

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, eq=False)
class Simulation:
    """One simulated run; states are departures from the operating point.

    Attributes:
        plant: ``linear`` or ``mujoco``.
        control: ``event``, ``clock`` or ``continuous``.
        t: times of the rows [s], strictly increasing, shape (N,); the value at an event is the one before the reset.
        x, y, u, x_o, x_h: plant state, outputs, inputs, observer and hold state; shapes (N, ...). Under
            continuous control x_h is x_o.
        E: event function (eq. ED_e), shape (N,); NaN where there is no event rule.
        events: the events.
        outcome: how it ended.
        precision: facts on the integration (integrator, order, timestep, event tolerance, error estimate ...).
        delay: t_d from an event to its action [s].
        least: the least open-loop interval, the larger of Δ_min and t_d [s].
        noisy: whether noise acted, so that the motion is to be told by its statistics.
        qpos: MuJoCo positions for the 3D pose, shape (N, nq); empty (0, 0) for the linear plant.
        applied: what acts of command and disturbance within the limits of the actuators, in the units of u, shape
            (N, n_u): u + d where nothing saturates; empty (0, 0) for the linear plant where there is no disturbance,
            for it has no limits.
        pressure: the ground's reaction on a body that stands on a floor; ``None`` where nothing does.
    """

    plant: Literal["linear", "mujoco"]
    control: Kind
    t: Array
    x: Array
    y: Array
    u: Array
    x_o: Array
    x_h: Array
    E: Array
    events: Events
    outcome: Outcome
    precision: Mapping[str, float | int | str] = field(default_factory=dict)
    qpos: Array = field(default_factory=lambda: np.zeros((0, 0)))
    delay: float = 0.0
    applied: Array = field(default_factory=lambda: np.zeros((0, 0)))
    least: float = 0.0
    noisy: bool = False
    pressure: Pressure | None = None
