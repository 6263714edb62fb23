"""Actuator activations: their rates and limits, and the second-order lag that icmj adds.

An actuator with ``dyntype="user" actdim="2" dynprm="ω_n ζ"`` has the transfer function
ω_n²/(s² + 2ζω_n s + ω_n²) from control to torque (paper, section 4.1, "Neglected dynamics").
Its activations are (torque rate, torque); MuJoCo takes the last as the actuator's activation.
"""

from __future__ import annotations

import mujoco
import numpy as np

from icmj.base.array import Array


def is_second_order_lag(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether this actuator is a second-order lag by the convention above."""
    return (
        model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_USER
        and model.actuator_actnum[actuator] == 2
        and model.actuator_dynprm[actuator, 0] > 0
    )


def lag(u: float, rate: float, torque: float, omega_n: float, zeta: float) -> tuple[float, float]:
    """d/dt of (rate, torque) of a second-order lag with the input ``u``; compiled code calls it, too."""
    return omega_n * omega_n * (u - torque) - 2 * zeta * omega_n * rate, rate


def second_order_lag(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """MuJoCo activation callback in Python: writes ``act_dot`` of one second-order lag."""
    if is_second_order_lag(model, actuator):
        adr = model.actuator_actadr[actuator]
        data.act_dot[adr : adr + 2] = lag(
            data.ctrl[actuator], *data.act[adr : adr + 2], *model.actuator_dynprm[actuator, :2]
        )
    return 0.0


def clamped(model: mujoco.MjModel, act: Array) -> Array:
    """Activations as a step of the engine leaves them: within ``actrange``, shape (na,)."""
    there = act.copy()
    for i in np.flatnonzero(model.actuator_actlimited):
        own = slice(model.actuator_actadr[i], model.actuator_actadr[i] + model.actuator_actnum[i])
        there[own] = np.clip(act[own], *model.actuator_actrange[i])
    return there


def activation_rates(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Rates of the activations after a forward pass, shape (na,), as limited by ``actrange``.

    ``act_dot`` knows no ``actrange``.
    """
    wanted = data.act + model.opt.timestep * data.act_dot
    there = clamped(model, wanted)
    return np.where(there == wanted, data.act_dot, (there - data.act) / model.opt.timestep)
