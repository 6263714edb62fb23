"""What a rule for the operating point means on a model: the pose, what may move in it, what a body stands on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import mujoco
import numpy as np

from icmj.engine.model import OperatingPoint, model_name
from icmj.errors import ModelError
from icmj.plant.operating import OperatingRule


@contextmanager
def softened(model: mujoco.MjModel, factor: float) -> Iterator[None]:
    """Contacts and joint limits that give way by the square of ``factor`` times as much, and as gradually."""
    times = [array for array in (model.geom_solref, model.jnt_solref, model.pair_solref) if len(array)]
    widths = [array for array in (model.geom_solimp, model.jnt_solimp, model.pair_solimp) if len(array)]
    before = [array.copy() for array in (*times, *widths)]
    for array in times:
        # a negative entry is a stiffness, else a time constant [s]
        array[:, 0] *= np.where(array[:, 0] > 0, factor, factor**-2)
    for array in widths:
        array[:, 2] *= factor**2
    try:
        yield
    finally:
        for array, old in zip((*times, *widths), before, strict=True):
            array[:] = old


def posed(model: mujoco.MjModel, given: OperatingPoint, rule: OperatingRule) -> OperatingPoint:
    """What is given, with the joints of the rule's pose there."""
    qpos = given.qpos.copy()
    for name, value in rule.pose.items():
        joint = _joint(model, name, "pose")
        if model.jnt_type[joint] not in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
            raise ModelError(f"model {model_name(model)!r}: pose: {name} is not a hinge or a slide; use a keyframe")
        qpos[model.jnt_qposadr[joint]] = value
    return replace(given, qpos=qpos)


def _joint(model: mujoco.MjModel, name: str, verb: str) -> int:
    names = [model.joint(i).name or f"joint{i}" for i in range(model.njnt)]
    if name not in names:
        raise ModelError(f"model {model_name(model)!r} has no joint {name!r} to {verb}; it has {', '.join(names)}")
    return names.index(name)


def free(model: mujoco.MjModel, rule: OperatingRule) -> np.ndarray:
    """Degrees of freedom that may move."""
    if rule.kind == "static control":
        return np.zeros(0, dtype=int)
    chosen = [_joint(model, name, "free") for name in rule.free] or range(model.njnt)
    return np.array([i for i in range(model.nv) if int(model.dof_jntid[i]) in chosen], dtype=int)


def vertical(model: mujoco.MjModel, free: np.ndarray) -> int | None:
    """The degree of freedom that lifts a body off the floor: z of a free joint, or a vertical slide at the root."""
    for i in free:
        joint = int(model.dof_jntid[i])
        body, first = int(model.jnt_bodyid[joint]), int(model.jnt_dofadr[joint])
        if model.body_parentid[body] != 0:
            continue
        kind = model.jnt_type[joint]
        if kind == mujoco.mjtJoint.mjJNT_FREE and i == first + 2:
            return int(i)
        if kind == mujoco.mjtJoint.mjJNT_SLIDE and abs(model.jnt_axis[joint, 2]) > 0.99:
            return int(i)
    return None
