"""Forces on a model itself: their places as numbers for the loops, the generalised forces, and their effect.

A row of the table of places is (kind, index, nine numbers): of a hinge or slide joint its degree of freedom; of any
other input its actuator and 1/|gear|, for the actuator's moment follows the motion; of a body its number, the point in
its frame, force and torque along the axes of the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.model import (
    OperatingPoint,
    data_at,
    solve_fully,
)
from icmj.engine.safety import isolate_engine
from icmj.errors import SimulationError
from icmj.plant.linear_plant import Push, vector
from icmj.simulation.disturbance import Pushes

FREEDOM, ACTUATOR, BODY = 0, 1, 2
WIDTH = 11
_PUSH = 1e-4  # half the distance of a difference over a push, as a share of the forces at rest, by what they accelerate


def places(
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


def on_bodies(model: mujoco.MjModel, point: OperatingPoint, push: Push) -> tuple[Push, ...]:
    """The pushes on bodies that a push is: itself, or what a motion of the surface is for each body that it carries.

    These are −m a of a translation; −m φ n × g of gravity turned by a tilt φ about n; −m φ̈ n × r and −I n φ̈ of a
    turning, with the positions r and the inertias I of the operating point.

    Raises:
        SimulationError: if a body that the surface carries has no name.
    """
    if push.surface is None:
        return (push,)
    data, axis, found = data_at(model, point), np.array(push.axis), []
    mujoco.mj_fwdPosition(model, data)
    for body in range(1, model.nbody):
        mass, name = float(model.body_mass[body]), model.body(body).name
        if mass == 0 or model.body_weldid[body] == 0:
            continue
        if not name:
            raise SimulationError(f"{push.where}: body {body} of the model has no name; give it one")
        force, torque = -mass * axis, np.zeros(3)
        if push.surface == "gravity":
            # what compensates gravity turns with it
            force = -mass * (1 - float(model.body_gravcomp[body])) * np.cross(axis, model.opt.gravity)
        elif push.surface == "turning":
            turned = data.ximat[body].reshape(3, 3)
            force = -mass * np.cross(axis, data.xipos[body] - np.array(push.point or (0.0, 0.0, 0.0)))
            torque = -turned @ (model.body_inertia[body] * (turned.T @ axis))
        if np.any(force) or np.any(torque):
            found.append(Push(None, name, vector(force), vector(torque)))
    return tuple(found)


def spread(model: mujoco.MjModel, point: OperatingPoint, pushes: Pushes) -> Pushes:
    """The same with every motion of the surface as pushes on bodies, each with all terms of it."""
    if all(push.surface is None for push in pushes.places):
        return pushes
    parts = [on_bodies(model, point, push) for push in pushes.places]
    first, size = np.cumsum([0, *map(len, parts)]), pushes.size
    of = [range(first[i], first[i + 1]) for i in range(len(parts))]
    term = np.array([i for i, at in enumerate(size.input) for _ in of[at]], dtype=int)
    each = {name: getattr(size, name)[term] for name in ("amplitude", "omega", "phase", "start", "end")}
    rows = np.array([row for at in size.input for row in of[at]], dtype=int)
    gaussian = tuple((row, noise) for at, noise in size.gaussian for row in of[at])
    return Pushes(sum(parts, ()), replace(size, n_u=int(first[-1]), input=rows, gaussian=gaussian, **each))


def forces(model: mujoco.MjModel, data: mujoco.MjData, table: Array, sizes: Array) -> Array:
    """Generalised forces of pushes of these sizes where the model is, shape (nv,), after its positions are known."""
    total = np.zeros(model.nv)
    for (kind, index, *numbers), size in zip(table, sizes, strict=True):
        at = int(index)
        if kind == FREEDOM:
            total[at] += size * numbers[0]
        elif kind == ACTUATOR:
            first, count = int(data.moment_rowadr[at]), int(data.moment_rownnz[at])
            row = slice(first, first + count)
            total[data.moment_colind[row]] += size * numbers[0] * data.actuator_moment[row]
        else:
            point, force, torque = np.split(np.array(numbers), 3)
            there = data.xpos[at] + data.xmat[at].reshape(3, 3) @ point
            mujoco.mj_applyFT(model, data, size * force, size * torque, there, at, total)
    return total


def effects(model: mujoco.MjModel, point: OperatingPoint, table: Array) -> Array:
    """Effects of pushes of size 1 on the rates of (qpos, qvel, act) at ``point``, shape (n, K).

    Where no constraint acts, accelerations are linear in forces; elsewhere they are differenced.
    """
    nv, data, found = model.nv, data_at(model, point), np.zeros((2 * model.nv + model.na, len(table)))

    def accelerate(force: Array) -> Array:
        """The accelerations that a force would cause without constraints, M⁻¹ f."""
        result = np.zeros((1, nv))
        mujoco.mj_solveM(model, data, result, np.ascontiguousarray(force[None]))
        return result[0]

    with isolate_engine(), solve_fully(model):
        mujoco.mj_forward(model, data)
        acting = (data.qfrc_bias, data.qfrc_passive, data.qfrc_actuator, data.qfrc_constraint)
        rest = max(float(force @ accelerate(force)) for force in acting)
        for column, row in zip(found.T, table, strict=True):
            force = forces(model, data, row[None], np.ones(1))
            column[nv : 2 * nv] = free = accelerate(force)
            if not data.nefc or not force.any():
                continue
            step, column[nv : 2 * nv] = _PUSH * np.sqrt(rest / (force @ free)) if rest > 0 else 1.0, 0.0
            for sign in (1.0, -1.0):
                data.qfrc_applied[:] = sign * step * force
                mujoco.mj_forward(model, data)
                column[nv : 2 * nv] += sign / (2 * step) * data.qacc
    return found


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
