"""Rates ẋ and outputs y of a plant on the engine, as functions of (x, u) and as systems of python-control.

All are departures from rest.
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.engine.activations import activation_rates, clamp
from icmj.engine.isolation import isolate_engine
from icmj.engine.plant import MujocoPlant, place
from icmj.simulation.labels import as_plain_names, name_loop_signals

if TYPE_CHECKING:
    from control import NonlinearIOSystem


_EPS = 1e-6  # s, over which a velocity moves positions that are no vectors


class Dynamics:
    """ẋ and y of a plant on the engine, as functions of (x, u): departures in the linearisation's coordinates.

    States that the plant leaves out stay at the operating point.
    """

    def __init__(self, plant: MujocoPlant) -> None:
        self.plant = plant
        self.model = copy(plant.model)  # its solver is set to iterate to the end
        self.model.opt.tolerance, self.model.opt.iterations = 0.0, max(200, self.model.opt.iterations)
        self.data = mujoco.MjData(self.model)

    def __call__(self, x: Array, u: Array) -> tuple[Array, Array]:
        """ẋ and y, shapes (n,) and (n_y,)."""
        model, data = self.model, self.data
        self.forward(x, u)
        moved = data.qvel.copy() if model.nq == model.nv else self._turning()
        here = self.plant.linearisation
        rate = here.ports.reduce(np.concatenate([moved, data.qacc, activation_rates(model, data)]))
        return rate, here.ports.read(data.sensordata) - here.y

    def forward(self, x: Array, u: Array) -> None:
        """Run a forward pass at x and u, which leaves its results in ``data``."""
        model, data = self.model, self.data
        place(self.plant, data, self.plant.linearisation.ports.whole(np.asarray(x, float)), u)
        data.act[:] = clamp(model, data.act)
        with isolate_engine():
            mujoco.mj_forward(model, data)

    def _turning(self) -> Array:
        """d/dt of the departure of positions, some of which are quaternions, at the present velocity; shape (nv,)."""
        model, data, point = self.model, self.data, self.plant.linearisation.point
        ends = np.zeros((2, model.nv))
        for end, eps in zip(ends, (_EPS, -_EPS), strict=True):
            q = data.qpos.copy()
            mujoco.mj_integratePos(model, q, data.qvel, eps)
            mujoco.mj_differentiatePos(model, end, 1.0, point.qpos, q)
        return np.asarray((ends[0] - ends[1]) / (2 * _EPS))


def plant_system(plant: MujocoPlant) -> NonlinearIOSystem:
    """The plant alone: inputs u, outputs y, states x, with the names of its linearisation."""
    import control

    dynamics, linear = Dynamics(plant), plant.linearisation.plant
    return control.NonlinearIOSystem(
        lambda t, x, u, params: dynamics(x, u)[0],
        lambda t, x, u, params: dynamics(x, u)[1],
        name="plant",
        **{key: as_plain_names(getattr(linear, key)) for key in ("inputs", "outputs", "states")},
    )


def continuous_loop(plant: MujocoPlant, controller: Controller) -> NonlinearIOSystem:
    """The loop under u = −k̂ x_o, with inputs, outputs and states as :func:`icmj.linear.systems.continuous_loop`."""
    import control

    dynamics, linear, design = Dynamics(plant), plant.linearisation.plant, controller.design
    n, n_u = linear.n, linear.n_u

    def rate(t: float, z: Array, inputs: Array, params: Any) -> Array:
        x, x_o, d, n_y = z[:n], z[n:], inputs[:n_u], inputs[n_u:]
        u = -design.k @ x_o
        x_rate, y = dynamics(x, u + d)
        return np.concatenate([x_rate, design.A_o @ x_o + design.plant.B @ u + design.L @ (y + n_y)])

    def output(t: float, z: Array, inputs: Array, params: Any) -> Array:
        u = -design.k @ z[n:]
        return np.concatenate([dynamics(z[:n], u + inputs[:n_u])[1], u])

    return control.NonlinearIOSystem(rate, output, name="closed_loop", **name_loop_signals(linear, design.plant, "x_o"))
