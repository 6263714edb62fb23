"""Which stages of MuJoCo's forward pass a composed model needs, and whether its motion is smooth.

``mj_forward`` looks for contacts, builds and solves constraints, refreshes every transmission and every sensor. Where a
model has none of these, fewer calls of the same functions give the same accelerations, to the last bit.
"""

from __future__ import annotations

from enum import IntEnum

import mujoco
import numpy as np


class Stages(IntEnum):
    """The stages that compute the accelerations of a model."""

    WHOLE = 0  # mj_forwardSkip: everything but the sensors
    SMOOTH = 1  # all but what contacts and other constraints need
    PLAIN = 2  # and the inputs are motors of constant moment: neither transmission nor actuation is called


_Joint, _Sensor, _Disable = mujoco.mjtJoint, mujoco.mjtSensor, mujoco.mjtDisableBit
_KINEMATIC = {
    int(getattr(_Sensor, f"mjSENS_{name}"))
    for name in (
        "JOINTPOS", "TENDONPOS", "BALLQUAT", "FRAMEPOS", "FRAMEQUAT", "FRAMEXAXIS", "FRAMEYAXIS", "FRAMEZAXIS",
        "SUBTREECOM", "JOINTVEL", "BALLANGVEL", "GYRO", "VELOCIMETER", "FRAMELINVEL", "FRAMEANGVEL", "CLOCK",
    )
}  # fmt: skip
_DRIVEN = {
    int(getattr(_Sensor, f"mjSENS_{name}"))
    for name in ("ACTUATORPOS", "ACTUATORVEL", "TENDONVEL", "SUBTREELINVEL", "SUBTREEANGMOM")
}
_KNOWN = {
    int(getattr(mujoco.mjtDyn, f"mjDYN_{name}"))
    for name in ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT", "MUSCLE", "USER")
}
# activations that the engine itself moves by more than their rate
_MOVED = {int(mujoco.mjtDyn.mjDYN_INTEGRATOR), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)}


def choose_stages(model: mujoco.MjModel) -> Stages:
    """The fewest stages that give the accelerations of a composed model."""
    sensors = set(model.sensor_type[model.sensor_needstage != mujoco.mjtStage.mjSTAGE_ACC].tolist())
    driven = sensors - _KINEMATIC
    odd = model.flg_adhesion or model.opt.disableactuator or model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_ENERGY
    odd = odd or model.opt.disableflags & (_Disable.mjDSBL_ACTUATION | _Disable.mjDSBL_SENSOR)
    moved = not _MOVED.isdisjoint(model.actuator_dyntype.tolist())
    if odd or moved or not is_flow(model) or may_constrain(model) or not driven <= _DRIVEN:
        return Stages.WHOLE
    return Stages.PLAIN if not driven and _plain(model) else Stages.SMOOTH


def may_constrain(model: mujoco.MjModel) -> bool:
    """Whether a contact, limit, friction loss or equality could ever act in this model."""
    flags = model.opt.disableflags
    if flags & _Disable.mjDSBL_CONSTRAINT:
        return False
    if model.nflex or (model.neq and not flags & _Disable.mjDSBL_EQUALITY):
        return True
    if not flags & _Disable.mjDSBL_FRICTIONLOSS and (model.dof_frictionloss.any() or model.tendon_frictionloss.any()):
        return True
    if not flags & _Disable.mjDSBL_LIMIT and (model.jnt_limited.any() or model.tendon_limited.any()):
        return True
    touching = np.count_nonzero(model.geom_contype | model.geom_conaffinity)
    return not flags & _Disable.mjDSBL_CONTACT and bool(model.npair or touching > 1)


def is_flow(model: mujoco.MjModel) -> bool:
    """Whether the state moves as dx/dt = f(x, t): no activation is clamped or taken a step ahead, no body sleeps."""
    return has_rates(model) and not (model.actuator_actlimited.any() or model.actuator_actearly.any())


def has_rates(model: mujoco.MjModel) -> bool:
    """Whether a step moves the state by its rates, and at most takes activations back into their ranges."""
    awake = not model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP and not model.nplugin and not model.nflex
    return bool(not model.nplastic and awake and _KNOWN.issuperset(model.actuator_dyntype.tolist()))


def _plain(model: mujoco.MjModel) -> bool:
    """Whether every actuator but the controller's is a motor without limits whose moment never changes."""
    motors = slice(0, model.nactuator - 1)
    jointed = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
    scalar_joints = np.isin(model.jnt_type, (_Joint.mjJNT_HINGE, _Joint.mjJNT_SLIDE))
    jointed[jointed] = scalar_joints[model.actuator_trnid[jointed, 0]]
    fixed = (model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED) & (
        model.actuator_biastype == mujoco.mjtBias.mjBIAS_NONE
    )
    stateless = model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE
    limits = model.actuator_ctrllimited.any() or model.actuator_forcelimited.any() or model.jnt_actfrclimited.any()
    drag = any(
        array.any()
        for array in (
            model.actuator_damping, model.actuator_dampingpoly, model.actuator_armature, model.jnt_actgravcomp,
            model.tendon_damping, model.tendon_dampingpoly, model.tendon_armature, model.tendon_actfrclimited,
        )
    )  # fmt: skip
    scalar = model.nu == model.nactuator == model.nout and not model.nhistory
    return bool(scalar and (jointed & fixed & stateless)[motors].all() and not limits and not drag)
