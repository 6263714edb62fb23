"""The actuator that icmj adds to MuJoCo: a second-order lag as user activation dynamics.

An actuator with ``dyntype="user" actdim="2" dynprm="ω_n ζ"`` has the transfer function
ω_n²/(s² + 2ζω_n s + ω_n²) from control to torque (paper, section 4.1, "Neglected dynamics").
Its activations are (torque rate, torque); MuJoCo takes the last as the actuator's activation.
"""

from __future__ import annotations

import mujoco


def is_second_order_lag(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether this actuator is a second-order lag by the convention above."""
    return (
        model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_USER
        and model.actuator_actnum[actuator] == 2
        and model.actuator_dynprm[actuator, 0] > 0
    )


def second_order_lag(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    """MuJoCo activation callback in Python: writes ``act_dot`` of one second-order lag."""
    if is_second_order_lag(model, actuator):
        adr = model.actuator_actadr[actuator]
        omega_n, zeta = model.actuator_dynprm[actuator, :2]
        rate, torque = data.act[adr : adr + 2]
        data.act_dot[adr] = omega_n**2 * (data.ctrl[actuator] - torque) - 2 * zeta * omega_n * rate
        data.act_dot[adr + 1] = rate
    return 0.0
