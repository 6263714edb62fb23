"""An MJCF plant as an input-output system of python-control: nonlinear, in departures from its operating point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.engine.dynamics import Dynamics
from icmj.engine.plant import MujocoPlant
from icmj.simulation.labels import loop_signals, plain_names

if TYPE_CHECKING:
    from control import NonlinearIOSystem


def plant_system(plant: MujocoPlant) -> NonlinearIOSystem:
    """The plant alone: inputs u, outputs y, states x, with the names of its linearisation."""
    import control

    dynamics, linear = Dynamics(plant), plant.linearisation.plant
    return control.NonlinearIOSystem(
        lambda t, x, u, params: dynamics(x, u)[0],
        lambda t, x, u, params: dynamics(x, u)[1],
        name="plant",
        **{key: plain_names(getattr(linear, key)) for key in ("inputs", "outputs", "states")},
    )


def continuous_loop(plant: MujocoPlant, controller: Controller) -> NonlinearIOSystem:
    """The loop under u = −k̂ x_o, with inputs, outputs and states as :func:`icmj.linear.iosystem.continuous_loop`."""
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

    return control.NonlinearIOSystem(rate, output, name="closed_loop", **loop_signals(linear, design.plant, "x_o"))
