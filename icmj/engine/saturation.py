"""What of a command passes the limits of the actuators: ranges of control and of force."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.actuator import second_order_lag
from icmj.engine.callbacks import installed
from icmj.engine.plant import MujocoPlant
from icmj.simulation.disturbance import Disturbance


def limited(model: mujoco.MjModel) -> bool:
    """Whether any actuator, or the joint that it moves, has a limit."""
    return bool(
        model.actuator_ctrllimited.any()
        or model.actuator_forcelimited.any()
        or model.jnt_actfrclimited.any()
        or (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE).any()
    )


def applied(plant: MujocoPlant, disturbance: Disturbance, rows: Array, u: Array) -> tuple[Array, np.ndarray]:
    """What acts of u + d, in the units of u, and where it is less than that; both of shape (N, n_u).

    A limit of force takes away as much of the control as would give what it cuts off; of an actuator with dynamics of
    its own, or of a joint's limit, it is told that it saturates, and the control stays.

    Args:
        plant: the plant.
        disturbance: d on its inputs.
        rows: recorded (t, qpos, qvel, act, ...), shape (N, ...).
        u: commands, shape (N, n_u).
    """
    model, ports, point = plant.model, plant.linearisation.ports, plant.linearisation.point
    wanted = u + disturbance(rows[:, 0])
    if not limited(model):
        return wanted, np.zeros(wanted.shape, dtype=bool)
    ctrl = np.tile(point.ctrl, (len(rows), 1))
    ctrl[:, ports.actuators] += ports.b * wanted
    passed = np.clip(ctrl, *_range(model))
    cut = np.abs(passed - ctrl) > 1e-12 * (1 + np.abs(ctrl))
    if model.actuator_forcelimited.any() or model.jnt_actfrclimited.any():
        passed, beyond = _within_force(copy(model), rows, passed)
        cut |= beyond
    b = np.where(ports.b == 0, 1.0, ports.b)
    acting = (passed - point.ctrl)[:, ports.actuators] / b
    there = cut[:, ports.actuators]
    return np.where(there, acting, wanted), there


def shares(inputs: Sequence[str], cut: np.ndarray) -> dict[str, float | str]:
    """How much of the rows saturates: as one number, and as text for each input that does."""
    facts: dict[str, float | str] = {"saturated_share": float(cut.any(axis=1).mean())}
    each = [f"{name} {share:.1%}" for name, share in zip(inputs, cut.mean(axis=0), strict=True) if share > 0]
    return facts | ({"saturated": ", ".join(each)} if each else {})


def _range(model: mujoco.MjModel) -> tuple[Array, Array]:
    low, high = model.actuator_ctrlrange.T.copy()
    free = ~model.actuator_ctrllimited.astype(bool)
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL):
        free[:] = True
    low[free], high[free] = -np.inf, np.inf
    muscle = model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE
    return np.where(muscle, np.maximum(low, 0), low), np.where(muscle, np.minimum(high, 1), high)


def _within_force(model: mujoco.MjModel, rows: Array, ctrl: Array) -> tuple[Array, np.ndarray]:
    """Controls less what limits of force cut off, and which they are; the model's limits are lifted on the way."""
    data, nq, nv, na = mujoco.MjData(model), model.nq, model.nv, model.na
    passed, cut = ctrl.copy(), np.zeros(ctrl.shape, dtype=bool)
    forced, joints = model.actuator_forcelimited.astype(bool), model.jnt_actfrclimited.astype(bool)
    low, high = model.actuator_forcerange.T
    direct = forced & (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE)
    on_joint = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
    at = np.where(on_joint, model.actuator_trnid[:, 0], -1)

    def force(control: Array) -> Array:
        data.ctrl[:] = control
        mujoco.mj_fwdActuation(model, data)
        return data.actuator_force.copy()

    try:
        with installed(act_dyn=second_order_lag):
            for i, row in enumerate(rows):
                data.qpos[:], data.qvel[:] = row[1 : 1 + nq], row[1 + nq : 1 + nq + nv]
                data.act[:] = row[1 + nq + nv : 1 + nq + nv + na]
                mujoco.mj_fwdPosition(model, data)
                mujoco.mj_fwdVelocity(model, data)
                model.actuator_forcelimited[:] = False
                free = force(ctrl[i])
                slope = force(ctrl[i] + 1.0) - free if direct.any() else np.ones(model.nu)
                model.actuator_forcelimited[:] = forced
                inside = np.where(forced, np.clip(free, low, high), free)
                cut[i] = np.abs(inside - free) > 1e-12 * (1 + np.abs(free))
                there = direct & cut[i] & (slope != 0)
                passed[i, there] += (inside - free)[there] / slope[there]
                for joint in np.flatnonzero(joints):
                    mine = at == joint
                    torque = float((inside * model.actuator_gear[:, 0])[mine].sum())
                    least, most = model.jnt_actfrcrange[joint]
                    if not least <= torque <= most:
                        cut[i, mine] = True
    finally:
        model.actuator_forcelimited[:] = forced
    return passed, cut
