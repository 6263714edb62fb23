"""Linearisation of an MJCF plant by centred finite differences of ``mj_forward``."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.actuator import is_second_order_lag, second_order_lag
from icmj.engine.callbacks import installed
from icmj.engine.model import OperatingPoint, input_names, model_name, operating_point, output_names, state_names
from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant

EPS = 1e-5  # balances truncation (eps²) against rounding (1/eps): 2e-9 on the three-link model


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A linear plant and where it holds.

    Attributes:
        plant: ẋ = A x + B u, y = C x in departures from the operating point;
            x = (nv positions in the tangent space, nv velocities, na activations).
        point: the operating point.
        y: the outputs there, shape (n_y,).
        residual: largest |acceleration| or |activation rate| there; zero at an equilibrium.
    """

    plant: LinearPlant
    point: OperatingPoint
    y: Array
    residual: float


def linearise(model: mujoco.MjModel, keyframe: str | None = None, eps: float = EPS) -> Linearisation:
    """Linearise ``model`` at a keyframe (or its reference configuration).

    Positions are perturbed in the tangent space, so quaternion joints are right too. Actuators that are
    second-order lags (see :mod:`icmj.engine.actuator`) are included; any callback installed is taken off meanwhile.

    Raises:
        ModelError: if there is no such keyframe, the model has no input or no output, an actuator has user
            dynamics other than a second-order lag, or a derivative is not finite.
    """
    name = model_name(model)
    if model.nu == 0 or model.nsensordata == 0:
        missing = "actuator" if model.nu == 0 else "sensor"
        raise ModelError(f"model {name!r} has no {missing}; inputs are its actuators and outputs its sensors")
    for i in range(model.nu):
        if model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_USER and not is_second_order_lag(model, i):
            raise ModelError(
                f"model {name!r}: actuator {input_names(model)[i]!r} has user activation dynamics that icmj does not "
                'know; it knows second-order lags, actdim="2" dynprm="ω_n ζ" with ω_n > 0'
            )
    point = operating_point(model, keyframe)
    data = mujoco.MjData(model)
    nv, na, nu = model.nv, model.na, model.nu

    def evaluate(x: Array, u: Array) -> tuple[Array, Array]:
        data.qpos[:] = point.qpos
        mujoco.mj_integratePos(model, data.qpos, x[:nv], 1.0)
        data.qvel[:] = point.qvel + x[nv : 2 * nv]
        data.act[:] = point.act + x[2 * nv :]
        data.ctrl[:] = point.ctrl + u
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot]), data.sensordata.copy()

    n = 2 * nv + na
    A, B, C = np.zeros((n, n)), np.zeros((n, nu)), np.zeros((model.nsensordata, n))
    with installed(act_dyn=second_order_lag):
        rest, y = evaluate(np.zeros(n), np.zeros(nu))
        for j in range(n + nu):
            step = np.zeros(n + nu)
            step[j] = eps
            (f_up, y_up), (f_down, y_down) = (evaluate(s[:n], s[n:]) for s in (step, -step))
            if j < n:
                A[:, j], C[:, j] = (f_up - f_down) / (2 * eps), (y_up - y_down) / (2 * eps)
            else:
                B[:, j - n] = (f_up - f_down) / (2 * eps)
    A[:nv] = np.hstack([np.zeros((nv, nv)), np.eye(nv), np.zeros((nv, na))])
    B[:nv] = 0
    if not all(np.isfinite(M).all() for M in (A, B, C)):
        raise ModelError(f"model {name!r} has no finite linearisation at keyframe {keyframe!r}")
    plant = LinearPlant(A, B, C, state_names(model), input_names(model), output_names(model))
    return Linearisation(plant, point, y, float(np.abs(rest[nv:]).max()))
