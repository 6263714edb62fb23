"""The room that joints have within their ranges.

Poses to start from are bent away from the ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.model import OperatingPoint
from icmj.plant.body import OperatingRule

Room = tuple[Array, Array]  # how far each degree of freedom may go down and up
_BENDS = (0.1, 0.25)  # of a joint's range


def list_starts(
    model: mujoco.MjModel, given: OperatingPoint, rule: OperatingRule, moving: np.ndarray
) -> Iterator[tuple[OperatingPoint, Room]]:
    """Starting points and ranges of the search for a balance: the given state, then joints bent into their ranges.

    Those of the rule's pose are not.
    """
    yield given, measure_room(model, given, rule, 0.0)
    for share in _BENDS:
        start = bend(model, given, moving, rule, share)
        if not np.array_equal(start.qpos, given.qpos):
            yield start, measure_room(model, start, rule, share / 2)


def bend(
    model: mujoco.MjModel, given: OperatingPoint, moving: np.ndarray, rule: OperatingRule, share: float
) -> OperatingPoint:
    """The given state with free joints at least ``share`` of their range away from its ends."""
    low, high = measure_room(model, given, rule, share)
    step = np.zeros(model.nv)
    step[moving] = np.clip(0.0, low, high)[moving]
    qpos = given.qpos.copy()
    mujoco.mj_integratePos(model, qpos, step, 1.0)
    return replace(given, qpos=qpos)


def measure_room(model: mujoco.MjModel, given: OperatingPoint, rule: OperatingRule, share: float) -> Room:
    """The distances that every degree of freedom may go down and up to stay ``share`` of its range from its ends.

    Without a share, and where there is no range, it is not bounded; nor are joints in the rule's pose.
    """
    low, high = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    for i in find_limited(model) if share else ():
        joint = int(model.dof_jntid[i])
        if model.joint(joint).name not in rule.pose:
            at, (least, most) = given.qpos[model.jnt_qposadr[joint]], model.jnt_range[joint]
            low[i], high[i] = least + share * (most - least) - at, most - share * (most - least) - at
    return low, high


def find_limited(model: mujoco.MjModel) -> list[int]:
    """Degrees of freedom of hinges and slides that have a range."""
    kinds = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    joints = (int(joint) for joint in model.dof_jntid)
    return [i for i, j in enumerate(joints) if model.jnt_limited[j] and model.jnt_type[j] in kinds]
