"""Where pushes act on a model, as a table of numbers for the compiled loops.

A row is (kind, index, nine numbers): of a hinge or slide joint its degree of freedom; of any other input its actuator
and 1/|gear|, for the actuator's moment follows the motion; of a body its number, the point in its frame, force and
torque along the axes of the world.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.errors import SimulationError
from icmj.plant.linear_plant import Push

FREEDOM, ACTUATOR, BODY = 0, 1, 2
WIDTH = 11


def make_table(
    model: mujoco.MjModel, pushes: Sequence[Push], inputs: Sequence[str], actuators: Sequence[int] | np.ndarray
) -> Array:
    """The table of where ``pushes`` act, shape (K, 11); ``actuators`` are those of the plant's ``inputs``.

    Raises:
        SimulationError: if there is no such input or body, or it is the world, or what the input moves has no gear.
    """
    table = np.zeros((len(pushes), WIDTH))
    for row, push in zip(table, pushes, strict=True):
        if push.input is not None:
            if push.input not in inputs:
                raise SimulationError(f"push on input {push.input!r}: the plant's inputs are {', '.join(inputs)}")
            row[:3] = _along(model, int(actuators[list(inputs).index(push.input)]))
            if row[2] == 0:
                raise SimulationError(f"push on input {push.input!r}: its gear is zero; push a body")
            continue
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, str(push.body))
        if body <= 0:
            known = ", ".join(filter(None, (model.body(i).name for i in range(1, model.nbody))))
            raise SimulationError(f"push on body {push.body!r}: the model's bodies are {known}")
        point = model.body_ipos[body] if push.point is None else push.point
        row[:] = BODY, body, *point, *push.force, *push.torque
    return table


def push_rows(model: mujoco.MjModel, actuators: Sequence[int] | np.ndarray) -> Array:
    """Rows of the table for pushes along what these actuators move; zero where gear says of none."""
    table = np.zeros((len(actuators), WIDTH))
    for row, actuator in zip(table, actuators, strict=True):
        row[:3] = _along(model, int(actuator))
    return table


def _along(model: mujoco.MjModel, actuator: int) -> tuple[float, float, float]:
    """Kind, index and factor of an input: 1 N or 1 N m on what it moves, along its length; 0 without a gear."""
    kind, gear = mujoco.mjtTrn(model.actuator_trntype[actuator]), model.actuator_gear[actuator]
    scalar = kind in (mujoco.mjtTrn.mjTRN_TENDON, mujoco.mjtTrn.mjTRN_SLIDERCRANK)
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        joint = int(model.actuator_trnid[actuator, 0])
        if mujoco.mjtJoint(model.jnt_type[joint]) in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            return FREEDOM, float(model.jnt_dofadr[joint]), float(np.sign(gear[0]) or 1.0)
    size = abs(gear[0]) if scalar else 1.0 if kind == mujoco.mjtTrn.mjTRN_BODY else float(np.linalg.norm(gear))
    return ACTUATOR, float(actuator), 1.0 / size if size > 0 else 0.0
