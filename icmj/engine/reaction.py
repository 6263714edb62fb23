"""The ground reaction on a model, from the motion of all its mass by Newton and Euler, for fixed or free feet.

F = M (a − g) acts on the centre of mass, and the moment about it is the rate of angular momentum; both follow from
states and inputs of every row. The force starts where it has no moment about horizontal axes, on the level ground.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.actuator import second_order_lag
from icmj.engine.callbacks import hushed, installed
from icmj.engine.model import solved_to_the_end
from icmj.engine.plant import MujocoPlant, place
from icmj.errors import ModelError
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation

_STEP = 1e-5  # of a central difference, in the unit of a state, or of the torque that moves it so far


@dataclass(frozen=True, eq=False)
class Reaction:
    """The linearised reaction of the ground, forwards or sideways, as a deviation from that at the operating point.

    Attributes:
        mass: mass of all moving bodies [kg].
        height: height of their common centre of mass above the ground [m].
        C, D: matrices from the states and from the acting inputs of the plant to (θ_F [rad], p [m]), shapes (2, n),
            (2, n_u).
    """

    mass: float
    height: float
    C: Array
    D: Array


def reaction(plant: MujocoPlant, axis: str = "x", level: float | None = None) -> Reaction:
    """The linearised reaction of the ground on ``plant``.

    Args:
        plant: a plant from :func:`icmj.load_plant`.
        axis: ``x`` or ``y``.
        level: height of the ground in the world [m]; by default that of the model's horizontal plane, or 0 without one.

    Raises:
        ModelError: if gravity does not press the plant down, or the axis is neither ``x`` nor ``y``.
    """
    ground = _Ground(plant, level)
    place = _place(axis)
    ports = plant.linearisation.ports
    n, n_u = len(ports.states), len(ports.actuators)
    rows = []
    u_step = _STEP * max(1.0, ground.mass)  # N m that turn so much mass as little
    for which, count, step in ((0, n, _STEP), (1, n_u, u_step)):
        shifts = np.concatenate([np.eye(count), -np.eye(count)]) * step
        still = np.zeros((2 * count, n_u if which == 0 else n))
        force, p = ground.forces(shifts, still) if which == 0 else ground.forces(still, shifts)
        both = np.stack([-force[:, place] / force[:, 2], p[:, place]])
        rows.append((both[:, :count] - both[:, count:]) / (2 * step))
    return Reaction(ground.mass, ground.height, rows[0], rows[1])


def ground_force(plant: MujocoPlant, simulation: Simulation, level: float | None = None) -> Series:
    """The ground reaction force and the centre of pressure at every row of a run, on either plant.

    Args:
        plant: the actual plant.
        simulation: a run of this plant.
        level: height of the ground in the world [m]; as for :func:`reaction`.

    Returns:
        A series with the forces ``force.x``, ``force.y``, ``force.z`` on the body [N], and ``cop.x``, ``cop.y`` [m].

    Raises:
        ModelError: if the simulation is not one of this plant, another external force acts on a body, or gravity does
            not press the plant down.
    """
    n = len(plant.linearisation.ports.states)
    if simulation.x.shape[1] != n:
        raise ModelError(f"{plant.path}: the simulation has {simulation.x.shape[1]} states, not {n}")
    bodies = [push.where for push in simulation.pushes if push.input is None]
    if bodies:
        raise ModelError(
            f"{plant.path}: {bodies[0]} is pushed, so that its motion does not determine the force of the ground"
        )
    acting = simulation.applied if simulation.applied.size else simulation.u
    for column, push in enumerate(simulation.pushes):  # along an input: a torque that the body makes
        acting = acting.copy()
        gear = plant.linearisation.ports.b[simulation.labels.inputs.index(push.where)]
        acting[:, simulation.labels.inputs.index(push.where)] += simulation.pushed[:, column] / gear
    force, p = _Ground(plant, level).forces(simulation.x, acting, simulation.qpos)
    return Series(
        simulation.t,
        np.concatenate([force, p], axis=1),
        ("force.x", "force.y", "force.z", "cop.x", "cop.y"),
        ("N", "N", "N", "m", "m"),
        {"plant": simulation.plant},
    )


class _Ground:
    """The ground reaction that the motion of a plant's mass requires."""

    def __init__(self, plant: MujocoPlant, level: float | None) -> None:
        self.model = copy(plant.model)
        self.plant, self.data = plant, mujoco.MjData(self.model)
        self.mass = float(self.model.body_subtreemass[0])
        self.level = _level(self.model) if level is None else level
        force, _ = self.forces(
            np.zeros((1, len(plant.linearisation.ports.states))),
            np.zeros((1, len(plant.linearisation.ports.actuators))),
        )
        if not force[0, 2] > 0:
            raise ModelError(f"{plant.path}: gravity does not press it down; expected a body above level ground")
        self.height = float(self.data.subtree_com[0, 2] - self.level)

    def forces(self, x: Array, u: Array, qpos: Array | None = None) -> tuple[Array, Array]:
        """Force (N, 3) and centre of pressure (N, 2) in states (N, n), or at positions (N, nq), under what acts."""
        model, data = self.model, self.data
        force, p = np.zeros((len(x), 3)), np.zeros((len(x), 2))
        with installed(act_dyn=second_order_lag), solved_to_the_end(model), hushed():
            for i, row in enumerate(self.plant.linearisation.ports.whole(x)):
                place(self.plant, data, row, u[i], None if qpos is None or not qpos.size else qpos[i])
                mujoco.mj_forward(model, data)
                mujoco.mj_rnePostConstraint(model, data)
                force[i], p[i] = self._wrench()
        return force, p

    def _wrench(self) -> tuple[Array, Array]:
        """Force, and where it starts, of the rate of momentum of every body that moves, less its weight."""
        model, data = self.model, self.data
        force, moment = np.zeros(3), np.zeros(3)
        for root in np.flatnonzero(model.body_parentid[1:] == 0) + 1:
            # what its parent does to a root body, and what contacts do to all of its tree: all that moves it
            tree = model.body_rootid == root
            wrench = data.cfrc_int[root] + data.cfrc_ext[tree].sum(axis=0)
            arm = data.subtree_com[root] - [0, 0, self.level]
            force += wrench[3:]
            moment += wrench[:3] + np.cross(arm, wrench[3:])
        # M = p × F on the ground, where p has no height
        return force, np.array([-moment[1], moment[0]]) / force[2] if force[2] else np.zeros(2)


def _level(model: mujoco.MjModel) -> float:
    """The height of the highest level plane of the world, 0 without one."""
    planes = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_bodyid == 0)
    up = [float(model.geom_pos[i, 2]) for i in np.flatnonzero(planes) if np.allclose(model.geom_quat[i, 1:3], 0)]
    return max(up, default=0.0)


def _place(axis: str) -> int:
    if axis not in ("x", "y"):
        raise ModelError(f"no axis {axis!r}; expected x or y")
    return "xy".index(axis)
