"""Saturation: the part of a command that passes the limits of control, activation and force.

Outputs that stand at a cutoff are found, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.activations import activation_rates, free_activation_rates
from icmj.engine.isolation import isolate_engine
from icmj.engine.plant import MujocoPlant
from icmj.simulation.disturbance import Disturbance

_FORCES, _TORQUES = ("actuator_forcelimited", "tendon_actfrclimited"), ("jnt_actfrclimited",)


def has_limit(model: mujoco.MjModel) -> bool:
    """Whether any actuator, or the joint or tendon that it moves, has a limit."""
    muscles = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE).any()
    return bool(muscles or model.actuator_ctrllimited.any() or _has_strength_limit(model))


def _has_strength_limit(model: mujoco.MjModel) -> bool:
    return any(getattr(model, name).any() for name in ("actuator_actlimited", *_FORCES, *_TORQUES))


def apply_limits(plant: MujocoPlant, disturbance: Disturbance, rows: Array, u: Array) -> tuple[Array, np.ndarray]:
    """The part of u + d that acts, in the units of u, and where it is limited; both of shape (N, n_u).

    A limit of force takes away as much of the control as would give what it cuts off; of an actuator with dynamics of
    its own, or of a joint's limit, it is told that it saturates, and the control stays.

    Args:
        plant: the plant.
        disturbance: d on its inputs.
        rows: recorded (t, qpos, qvel, act, ...), shape (N, ...).
        u: commands, shape (N, n_u).
    """
    model, ports, point = plant.model, plant.linearisation.ports, plant.linearisation.point
    wanted = u + disturbance.at_rows(rows[:, 0], u)
    if not has_limit(model):
        return wanted, np.zeros(wanted.shape, dtype=bool)
    ctrl = np.tile(point.ctrl, (len(rows), 1))
    ctrl[:, ports.actuators] += ports.b * wanted
    passed = np.clip(ctrl, *_range(model))
    cut = np.abs(passed - ctrl) > 1e-12 * (1 + np.abs(ctrl))
    if _has_strength_limit(model):
        passed, beyond = _within_force(copy(model), rows, passed)
        cut |= beyond
    b = np.where(ports.b == 0, 1.0, ports.b)
    acting = (passed - point.ctrl)[:, ports.actuators] / b
    there = cut[:, ports.actuators]
    return np.where(there, acting, wanted), there


def find_clipped(plant: MujocoPlant, rows: Array) -> np.ndarray:
    """Whether each output is at the cutoff of its sensor, shape (N, n_y).

    Args:
        plant: the plant.
        rows: recorded (..., sensordata), shape (N, ...).
    """
    model, entries = plant.model, plant.linearisation.ports.entries
    cutoff = np.repeat(model.sensor_cutoff, model.sensor_dim)[entries]
    there = np.abs(rows[:, rows.shape[1] - model.nsensordata :][:, entries]) >= cutoff
    return np.asarray(there & (cutoff > 0))


def measure_shares(inputs: Sequence[str], cut: np.ndarray, fact: str = "saturated") -> dict[str, float | str]:
    """The share of the rows that are limited: as one number, and as text for each limited input (or output)."""
    facts: dict[str, float | str] = {f"{fact}_share": float(cut.any(axis=1).mean())}
    each = [f"{name} {share:.1%}" for name, share in zip(inputs, cut.mean(axis=0), strict=True) if share > 0]
    return facts | ({fact: ", ".join(each)} if each else {})


def _range(model: mujoco.MjModel) -> tuple[Array, Array]:
    low, high = model.actuator_ctrlrange.T.copy()
    free = ~model.actuator_ctrllimited.astype(bool)
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL):
        free[:] = True
    low[free], high[free] = -np.inf, np.inf
    muscle = model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE
    return np.where(muscle, np.maximum(low, 0), low), np.where(muscle, np.minimum(high, 1), high)


def _within_force(model: mujoco.MjModel, rows: Array, ctrl: Array) -> tuple[Array, np.ndarray]:
    """Controls reduced by the limits of force, and whether these or an activation's range are reached.

    The engine says what each limit does: those of actuators and tendons, then those of joints, are lifted on the way.
    """
    data, nq, nv, na = mujoco.MjData(model), model.nq, model.nv, model.na
    passed, cut = ctrl.copy(), np.zeros(ctrl.shape, dtype=bool)
    switches = [(array, array.copy()) for array in (getattr(model, name) for name in (*_FORCES, *_TORQUES))]
    direct = model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE
    jointed, clamped = bool(model.jnt_actfrclimited.any()), np.flatnonzero(model.actuator_actlimited)

    def forces(control: Array, *, on_actuators: bool, on_joints: bool) -> tuple[Array, Array]:
        """Forces of the actuators and on the degrees of freedom under these limits."""
        for (array, limits), on in zip(switches, (on_actuators, on_actuators, on_joints), strict=True):
            array[:] = limits if on else False
        data.ctrl[:] = control
        mujoco.mj_fwdActuation(model, data)
        return data.actuator_force.copy(), data.qfrc_actuator.copy()

    with isolate_engine():
        for i, row in enumerate(rows):
            data.qpos[:], data.qvel[:] = row[1 : 1 + nq], row[1 + nq : 1 + nq + nv]
            data.act[:] = row[1 + nq + nv : 1 + nq + nv + na]
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            free, _ = forces(ctrl[i], on_actuators=False, on_joints=False)
            slope = forces(ctrl[i] + 1.0, on_actuators=False, on_joints=False)[0] - free
            inside, torque = forces(ctrl[i], on_actuators=True, on_joints=False)
            cut[i] = np.abs(inside - free) > 1e-12 * (1 + np.abs(free))
            there = direct & cut[i] & (slope != 0)
            passed[i, there] += (inside - free)[there] / slope[there]
            if jointed:
                left = forces(ctrl[i], on_actuators=True, on_joints=True)[1] - torque
                cut[i] |= _moments(data, nv) @ (np.abs(left) > 1e-12 * (1 + np.abs(torque))) > 0
            held = activation_rates(model, data) != free_activation_rates(model, data)
            for k in clamped:
                cut[i, k] |= held[model.actuator_actadr[k] :][: model.actuator_actnum[k]].any()
    return passed, cut


def _moments(data: mujoco.MjData, nv: int) -> np.ndarray:
    """Whether each actuator acts on each degree of freedom, shape (nu, nv)."""
    moments, rows = np.zeros((len(data.moment_rownnz), nv)), (data.moment_rownnz, data.moment_rowadr)
    mujoco.mju_sparse2dense(moments, data.actuator_moment, *rows, data.moment_colind)
    return moments != 0
