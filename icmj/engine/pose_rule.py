"""The rule for the operating point applied to a model: the pose, its free joints, and the support of a body."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import mujoco
import numpy as np

from icmj.engine.model import OperatingPoint, get_model_name, name_states
from icmj.engine.units import name_state_units
from icmj.errors import ModelError
from icmj.plant.body import OperatingRule
from icmj.plant.quality import Notice


@contextmanager
def soften(model: mujoco.MjModel, factor: float) -> Iterator[None]:
    """Contacts and joint limits made softer by the square of ``factor``."""
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


def apply_pose(model: mujoco.MjModel, given: OperatingPoint, rule: OperatingRule) -> OperatingPoint:
    """The given state with the joints of the rule's pose."""
    qpos = given.qpos.copy()
    for name, value in rule.pose.items():
        joint = _joint(model, name, "pose")
        if model.jnt_type[joint] not in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
            raise ModelError(f"model {get_model_name(model)!r}: pose: {name} is not a hinge or a slide; use a keyframe")
        qpos[model.jnt_qposadr[joint]] = value
    return replace(given, qpos=qpos)


def _joint(model: mujoco.MjModel, name: str, verb: str) -> int:
    names = [model.joint(i).name or f"joint{i}" for i in range(model.njnt)]
    if name not in names:
        raise ModelError(f"model {get_model_name(model)!r} has no joint {name!r} to {verb}; it has {', '.join(names)}")
    return names.index(name)


def free(model: mujoco.MjModel, rule: OperatingRule) -> np.ndarray:
    """Degrees of freedom that may move."""
    if rule.kind not in ("balance", "found"):
        return np.zeros(0, dtype=int)
    chosen = [_joint(model, name, "free") for name in rule.free] or range(model.njnt)
    return np.array([i for i in range(model.nv) if int(model.dof_jntid[i]) in chosen], dtype=int)


def list_ways(model: mujoco.MjModel, rule: OperatingRule) -> list[np.ndarray]:
    """Sets of degrees of freedom that may move: first the fewest that can balance a free body, then all.

    It keeps its place and stays upright; only its height is found.
    """
    moving = free(model, rule)
    loose = [i for i in moving if model.jnt_type[model.dof_jntid[i]] == int(mujoco.mjtJoint.mjJNT_FREE)]
    heights = [i for i in loose if i == model.jnt_dofadr[model.dof_jntid[i]] + 2]
    upright = np.array([i for i in moving if i not in loose or i in heights], dtype=int)
    return [upright, moving] if loose and not rule.free and len(upright) > len(heights) else [moving]


def find_vertical(model: mujoco.MjModel, free: np.ndarray) -> int | None:
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


def notice_move(model: mujoco.MjModel, given: OperatingPoint, found: OperatingPoint, why: str) -> Iterator[Notice]:
    """A notice if the operating point found differs from the given pose: by how much, and why."""
    gap = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, gap, 1.0, given.qpos, found.qpos)
    units = [unit.removesuffix("/s") for unit in name_state_units(model)[: model.nv]]
    far = [i for i in np.argsort(-np.abs(gap)) if abs(gap[i]) > max(1e-9, 1e-3 * np.abs(gap).max())]
    if not far and np.array_equal(given.ctrl, found.ctrl):
        return
    names = name_states(model)
    steps = [f"{names[i]} {gap[i]:+.3g} {units[i]}".rstrip() for i in far[:4]]
    more = f" and {len(far) - 4} more" if len(far) > 4 else ""
    where = f"away from it by {', '.join(steps)}{more}" if far else "with controls that hold it"
    words = f"the pose {why}; balanced {where}. Name a keyframe, a pose or operating_point to have another"
    yield Notice("operating point", "warning", words)
