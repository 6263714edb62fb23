"""Joints as outputs: position and velocity sensors added to a model that has none for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import mujoco

from icmj.engine.model import (
    name_outputs,
    place_sensors,
)
from icmj.plant.body import Selection
from icmj.plant.quality import Notice

RATE, TURN = "_rate", "_turn"
_SENSORS = {
    mujoco.mjtJoint.mjJNT_HINGE: (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL),
    mujoco.mjtJoint.mjJNT_SLIDE: (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL),
    mujoco.mjtJoint.mjJNT_BALL: (mujoco.mjtSensor.mjSENS_BALLQUAT, mujoco.mjtSensor.mjSENS_BALLANGVEL),
}


def add_sensors(
    spec: mujoco.MjSpec, model: mujoco.MjModel, selection: Selection
) -> tuple[Selection, tuple[Notice, ...], mujoco.MjModel]:
    """The selection with sensors for all its outputs, and a word where they were not named.

    ``"joints"`` means the positions of all joints, and so does a model without sensors; ``<joint>`` and
    ``<joint>_rate`` those of one. A ball joint gives its quaternion, a free joint the position of its body and, as
    ``<joint>_turn``, its quaternion; ``.0`` and so on single entries. Sensors that the model lacks are added. Names
    that are neither a sensor nor a joint stay, for :func:`icmj.engine.ports.find_ports` to refuse. ``model`` is
    what the spec compiles to; the last that is returned is what it then compiles to.
    """
    told: tuple[Notice, ...] = ()
    if selection.outputs is None:
        if len(spec.sensors) or not len(spec.joints):
            return selection, (), model
        selection = replace(selection, outputs="joints")
        told = (Notice("outputs", "warning", 'the model has no sensors; its outputs are its joints ("joints")'),)
    joints = {joint.name or f"joint{i}": joint for i, joint in enumerate(spec.joints)}
    nameless = [joint for joint in joints.values() if not joint.name]
    for name, joint in joints.items():
        joint.name = name
    everything = selection.outputs == "joints"
    wanted = tuple(joints) if everything else selection.outputs
    assert wanted is not None
    known = {*name_outputs(model), *place_sensors(model)}
    outputs: list[str] = []
    added: dict[tuple[str, bool], list[str]] = {}
    for name in (wanted,) if isinstance(wanted, str) else wanted:
        of, rate, turn, entry = _find_joint(name, joints)
        if (name in known and not everything) or of is None:
            outputs.append(name)
            continue
        if (of, rate) not in added:
            added[of, rate] = _add(spec, joints[of], rate, taken=known)
        labels = added[of, rate][1:] if turn else added[of, rate][:1] if entry else added[of, rate]
        outputs += [f"{label}{entry}" for label in labels]
    if nameless or added:
        model = spec.compile()
    return replace(selection, outputs=tuple(outputs), spare=everything), told, model


def _find_joint(name: str, joints: Mapping[str, object]) -> tuple[str | None, bool, bool, str]:
    """The joint that an output is of, whether its rate, whether its quaternion, and which entry, such as ".0"."""
    head, dot, number = (name, "", "") if name in joints else name.partition(".")
    for rate in (False, True):
        for turn in (False, True):
            joint = head.removesuffix(TURN) if turn else head
            joint = joint.removesuffix(RATE) if rate else joint
            if joint in joints and head == f"{joint}{RATE * rate}{TURN * turn}":
                return joint, rate, turn, f"{dot}{number}"
    return None, False, False, ""


def _add(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, rate: bool, taken: set[str]) -> list[str]:
    kind, name = mujoco.mjtJoint(joint.type), f"{joint.name}{RATE}" if rate else str(joint.name)
    if kind != mujoco.mjtJoint.mjJNT_FREE:
        return [_sensor(spec, name, _SENSORS[kind][rate], mujoco.mjtObj.mjOBJ_JOINT, joint.name, taken)]
    body = joint.parent
    body.name = body.name or f"{joint.name}_body"
    pair = ("FRAMELINVEL", "FRAMEANGVEL") if rate else ("FRAMEPOS", "FRAMEQUAT")
    return [
        _sensor(spec, label, getattr(mujoco.mjtSensor, f"mjSENS_{sort}"), mujoco.mjtObj.mjOBJ_XBODY, body.name, taken)
        for label, sort in zip((name, f"{name}{TURN}"), pair, strict=True)
    ]


def _sensor(
    spec: mujoco.MjSpec, name: str, kind: mujoco.mjtSensor, sort: mujoco.mjtObj, of: str, taken: set[str]
) -> str:
    # a sensor of this name may already be there and show something else
    label = name if name not in taken else f"{name}_position"
    spec.add_sensor(name=label, type=kind, objtype=sort, objname=of)
    return label
