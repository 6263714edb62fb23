"""Rates and outputs of a plant on the engine as functions of state and input, as departures from rest."""

from __future__ import annotations

from contextlib import nullcontext
from copy import copy

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.actuator import activation_rates, clamped, second_order_lag
from icmj.engine.callbacks import installed
from icmj.engine.plant import MujocoPlant

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
        # MuJoCo asks a callback for these alone, and to install one takes longer than a forward pass
        self.lags = bool((self.model.actuator_dyntype == mujoco.mjtDyn.mjDYN_USER).any())

    def __call__(self, x: Array, u: Array) -> tuple[Array, Array]:
        """ẋ and y, shapes (n,) and (n_y,)."""
        model, data = self.model, self.data
        self.forward(x, u)
        moved = data.qvel.copy() if model.nq == model.nv else self._turning()
        here = self.plant.linearisation
        rate = np.concatenate([moved, data.qacc, activation_rates(model, data)])[here.ports.states]
        return rate, here.ports.read(data.sensordata) - here.y

    def forward(self, x: Array, u: Array) -> None:
        """Run a forward pass at x and u, which leaves its results in ``data``."""
        model, data = self.model, self.data
        point, ports = self.plant.linearisation.point, self.plant.linearisation.ports
        whole, nv = ports.whole(np.asarray(x, float)), model.nv
        data.qpos[:] = point.qpos
        mujoco.mj_integratePos(model, data.qpos, np.ascontiguousarray(whole[:nv]), 1.0)
        data.qvel[:], data.act[:] = point.qvel + whole[nv : 2 * nv], clamped(model, point.act + whole[2 * nv :])
        data.ctrl[:] = point.ctrl
        data.ctrl[ports.actuators] += ports.b * u
        with installed(act_dyn=second_order_lag) if self.lags else nullcontext():
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
