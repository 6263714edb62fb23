"""Units of a model's states, inputs and outputs, from its joints, actuators and sensors; "" where it tells none."""

from __future__ import annotations

import mujoco
import numpy as np

from icmj.engine.activations import is_second_order_lag

_JOINT = {mujoco.mjtJoint.mjJNT_HINGE: ("rad",), mujoco.mjtJoint.mjJNT_SLIDE: ("m",),
          mujoco.mjtJoint.mjJNT_BALL: ("rad",) * 3, mujoco.mjtJoint.mjJNT_FREE: ("m",) * 3 + ("rad",) * 3}  # fmt: skip
_SENSOR = {
    "FRAMEPOS": "m", "SUBTREECOM": "m", "RANGEFINDER": "m", "GEOMDIST": "m", "FRAMELINVEL": "m/s",
    "VELOCIMETER": "m/s", "SUBTREELINVEL": "m/s", "GYRO": "rad/s", "FRAMEANGVEL": "rad/s", "BALLANGVEL": "rad/s",
    "ACCELEROMETER": "m/s²", "FRAMELINACC": "m/s²", "FRAMEANGACC": "rad/s²", "FORCE": "N", "TOUCH": "N",
    "TORQUE": "N m", "SUBTREEANGMOM": "kg m²/s", "CLOCK": "s", "E_POTENTIAL": "J", "E_KINETIC": "J",
}  # fmt: skip


def name_state_units(model: mujoco.MjModel) -> tuple[str, ...]:
    """One for each state; an activation's is known where it is a lag of the control."""
    q = [unit for i in range(model.njnt) for unit in _JOINT[mujoco.mjtJoint(model.jnt_type[i])]]
    return (*q, *(_per_second(unit) for unit in q), *(unit for i in range(model.nu) for unit in _activations(model, i)))


def name_input_units(model: mujoco.MjModel) -> tuple[str, ...]:
    """One for each actuator: N m or N for a motor (with its factor, where it has one), the servo's own for a servo."""
    return tuple(_input(model, i) for i in range(model.nu))


def name_output_units(model: mujoco.MjModel) -> tuple[str, ...]:
    """One for each entry of ``sensordata``."""
    return tuple(_output(model, i) for i in range(model.nsensor) for _ in range(int(model.sensor_dim[i])))


def _activations(model: mujoco.MjModel, i: int) -> tuple[str, ...]:
    if is_second_order_lag(model, i):
        return _per_second(_input(model, i)), _input(model, i)
    if mujoco.mjtDyn(model.actuator_dyntype[i]) in (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT):
        return (_input(model, i),)
    return ("",) * int(model.actuator_actnum[i])


def _per_second(unit: str) -> str:
    return f"{unit}/s" if unit else ""


def _input(model: mujoco.MjModel, i: int) -> str:
    kind, joint = mujoco.mjtTrn(model.actuator_trntype[i]), int(model.actuator_trnid[i, 0])
    moved = ""  # what the actuator's length is measured in
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        moved = _JOINT[mujoco.mjtJoint(model.jnt_type[joint])][0]
    elif kind == mujoco.mjtTrn.mjTRN_TENDON:
        moved = _tendon(model, joint)
    if not moved or model.actuator_gaintype[i] != mujoco.mjtGain.mjGAIN_FIXED:
        return ""
    factor, dynamics = float(model.actuator_gainprm[i, 0]), model.actuator_dyntype[i]
    if model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE:
        position, velocity = -model.actuator_biasprm[i, 1:3]
        if factor == 0 or dynamics == mujoco.mjtDyn.mjDYN_INTEGRATOR:
            return ""
        return moved if position == factor else _per_second(moved) if velocity == factor and position == 0 else ""
    if model.actuator_biastype[i] != mujoco.mjtBias.mjBIAS_NONE or dynamics == mujoco.mjtDyn.mjDYN_INTEGRATOR:
        return ""
    if kind != mujoco.mjtTrn.mjTRN_TENDON:
        factor *= float(np.abs(model.actuator_gear[i]).max())
    unit = "N m" if moved == "rad" else "N"
    return unit if abs(factor) == 1 else f"{abs(factor):g} {unit}"


def _output(model: mujoco.MjModel, i: int) -> str:
    kind, of = mujoco.mjtSensor(model.sensor_type[i]).name.removeprefix("mjSENS_"), int(model.sensor_objid[i])
    if kind.startswith("JOINT") and kind != "JOINTACTFRC":
        unit = _JOINT[mujoco.mjtJoint(model.jnt_type[of])][0]
        return {"JOINTPOS": unit, "JOINTVEL": _per_second(unit), "JOINTLIMITPOS": unit}.get(kind, "")
    if kind.startswith("TENDON") and kind in ("TENDONPOS", "TENDONVEL"):
        unit = _tendon(model, of)
        return unit if kind == "TENDONPOS" else _per_second(unit)
    return _SENSOR.get(kind, "")


def _tendon(model: mujoco.MjModel, i: int) -> str:
    """m for a spatial tendon; for a fixed one what its joints have in common."""
    first, count = int(model.tendon_adr[i]), int(model.tendon_num[i])
    if any(kind != mujoco.mjtWrap.mjWRAP_JOINT for kind in model.wrap_type[first : first + count]):
        return "m"
    joints = model.wrap_objid[first : first + count]
    units = {_JOINT[mujoco.mjtJoint(model.jnt_type[joint])][0] for joint in joints}
    return units.pop() if len(units) == 1 else ""
