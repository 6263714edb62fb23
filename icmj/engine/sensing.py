"""Joints as outputs: position and velocity sensors added to a model that has none for them."""

from __future__ import annotations

from dataclasses import replace

import mujoco

from icmj.engine.model import output_names, sensor_entries
from icmj.plant.selection import Selection

RATE = "_rate"
_SENSORS = {
    mujoco.mjtJoint.mjJNT_HINGE: (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL),
    mujoco.mjtJoint.mjJNT_SLIDE: (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL),
    mujoco.mjtJoint.mjJNT_BALL: (mujoco.mjtSensor.mjSENS_BALLQUAT, mujoco.mjtSensor.mjSENS_BALLANGVEL),
}


def sensed(spec: mujoco.MjSpec, selection: Selection) -> Selection:
    """The selection with sensors for all its outputs: those that the model lacks are added where a joint is meant.

    ``"joints"`` means the positions of all joints; ``<joint>`` and ``<joint>_rate`` those of one. A ball joint gives
    its quaternion, a free joint the position of its body and, as ``<joint>_turn``, its quaternion. Names that are
    neither a sensor nor a joint stay, for :func:`icmj.engine.ports.ports_of` to refuse.
    """
    if selection.outputs is None:
        return selection
    joints = {}
    for i, joint in enumerate(spec.joints):
        joint.name = joint.name or f"joint{i}"
        joints[joint.name] = joint
    everything = selection.outputs == "joints"
    wanted = tuple(joints) if everything or isinstance(selection.outputs, str) else selection.outputs
    if isinstance(selection.outputs, str) and not everything:
        wanted = (selection.outputs,)
    model = spec.compile()
    known = {*output_names(model), *sensor_entries(model)}
    outputs: list[str] = []
    for name in wanted:
        of = name if name in joints else name.removesuffix(RATE)
        if (name in known and not everything) or of not in joints:
            outputs.append(name)
            continue
        outputs += _added(spec, joints[of], rate=of != name, taken=known)
    return replace(selection, outputs=tuple(outputs))


def _added(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, rate: bool, taken: set[str]) -> list[str]:
    kind, name = mujoco.mjtJoint(joint.type), f"{joint.name}{RATE}" if rate else str(joint.name)
    if kind != mujoco.mjtJoint.mjJNT_FREE:
        return [_sensor(spec, name, _SENSORS[kind][rate], mujoco.mjtObj.mjOBJ_JOINT, joint.name, taken)]
    body = joint.parent
    body.name = body.name or f"{joint.name}_body"
    pair = ("FRAMELINVEL", "FRAMEANGVEL") if rate else ("FRAMEPOS", "FRAMEQUAT")
    return [
        _sensor(spec, label, getattr(mujoco.mjtSensor, f"mjSENS_{sort}"), mujoco.mjtObj.mjOBJ_XBODY, body.name, taken)
        for label, sort in zip((name, f"{name}_turn"), pair, strict=True)
    ]


def _sensor(
    spec: mujoco.MjSpec, name: str, kind: mujoco.mjtSensor, sort: mujoco.mjtObj, of: str, taken: set[str]
) -> str:
    # a sensor of this name may already be there and show something else
    label = name if name not in taken else f"{name}_position"
    spec.add_sensor(name=label, type=kind, objtype=sort, objname=of)
    return label
