"""The generalised forces f that pushes are on a model, and their effect M⁻¹ f on the rates of its state."""

from __future__ import annotations

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.isolation import isolate_engine
from icmj.engine.model import (
    OperatingPoint,
    make_data,
    solve_fully,
)
from icmj.engine.push_table import ACTUATOR, FREEDOM

_PUSH = 1e-4  # half the distance of a difference over a push, as a share of the forces at rest, by what they accelerate


def compute_forces(model: mujoco.MjModel, data: mujoco.MjData, table: Array, sizes: Array) -> Array:
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


def compute_effects(model: mujoco.MjModel, point: OperatingPoint, table: Array) -> Array:
    """Effects of pushes of size 1 on the rates of (qpos, qvel, act) at ``point``, shape (n, K).

    Where no constraint acts, accelerations are linear in forces; elsewhere they are differenced.
    """
    nv, data, found = model.nv, make_data(model, point), np.zeros((2 * model.nv + model.na, len(table)))

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
            force = compute_forces(model, data, row[None], np.ones(1))
            column[nv : 2 * nv] = free = accelerate(force)
            if not data.nefc or not force.any():
                continue
            step, column[nv : 2 * nv] = _PUSH * np.sqrt(rest / (force @ free)) if rest > 0 else 1.0, 0.0
            for sign in (1.0, -1.0):
                data.qfrc_applied[:] = sign * step * force
                mujoco.mj_forward(model, data)
                column[nv : 2 * nv] += sign / (2 * step) * data.qacc
    return found
