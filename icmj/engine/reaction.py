"""The ground reaction on a model: its force, where it starts (the centre of pressure), and the load on each contact.

For fixed or free feet it follows from the motion of all the model's mass, by Newton and Euler: F = M (a − g) acts on
the centre of mass, and the moment about it is the rate of angular momentum. The force starts where it has no moment
about horizontal axes, on the level ground. Of a body that stands on a floor the engine's contact forces tell the same,
to what its solver leaves, and how the load is shared; so it is then under pushes whose force the motion alone does not
tell. No output is either: a force depends directly on the inputs, D ≠ 0. States and inputs of every row are placed.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.law import Law
from icmj.engine.forces import compute_forces
from icmj.engine.isolation import isolate_engine
from icmj.engine.model import solve_fully
from icmj.engine.moving_ground import push_bodies
from icmj.engine.plant import MujocoPlant, place
from icmj.engine.push_table import make_table
from icmj.errors import ModelError
from icmj.series.series import Series
from icmj.simulation.pressure import Pressure
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
    ground, along = _Ground(plant, level), _axis(axis)
    mass, height = ground.weigh()
    ports = plant.linearisation.ports
    n, n_u = len(ports.states), len(ports.actuators)
    rows = []
    u_step = _STEP * max(1.0, mass)  # N m that turn so much mass as little
    for which, count, step in ((0, n, _STEP), (1, n_u, u_step)):
        shifts = np.concatenate([np.eye(count), -np.eye(count)]) * step
        still = np.zeros((2 * count, n_u if which == 0 else n))
        force, p = ground.wrenches(*((shifts, still) if which == 0 else (still, shifts)))
        both = np.stack([-force[:, along] / force[:, 2], p[:, along]])
        rows.append((both[:, :count] - both[:, count:]) / (2 * step))
    return Reaction(mass, height, rows[0], rows[1])


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
    _expect_states(plant, simulation)
    bodies = [push.where for push in simulation.pushes if push.input is None]
    if bodies:
        raise ModelError(
            f"{plant.path}: {bodies[0]} is pushed, so that its motion does not determine the force of the ground"
        )
    ground, acting = _Ground(plant, level), simulation.applied if simulation.applied.size else simulation.u
    ground.weigh()
    for column, push in enumerate(simulation.pushes):  # along an input: a torque that the body makes
        acting = acting.copy()
        gear = plant.linearisation.ports.b[simulation.labels.inputs.index(push.where)]
        acting[:, simulation.labels.inputs.index(push.where)] += simulation.pushed[:, column] / gear
    force, p = ground.wrenches(simulation.x, acting, simulation.qpos)
    return Series(
        simulation.t,
        np.concatenate([force, p], axis=1),
        ("force.x", "force.y", "force.z", "cop.x", "cop.y"),
        ("N", "N", "N", "m", "m"),
        {"plant": simulation.plant},
    )


def add_pressure(plant: MujocoPlant, controller: Law, simulation: Simulation) -> Simulation:
    """The simulation with the ground reaction if the plant stands on a floor, otherwise unchanged."""
    if not (_Ground(plant).at_rest()[1] > 0).any():
        return simulation
    return replace(simulation, pressure=centre_of_pressure(plant, simulation, controller))


def centre_of_pressure(plant: MujocoPlant, simulation: Simulation, controller: Law | None = None) -> Pressure:
    """The ground reaction at every row of ``simulation``, on either plant.

    Args:
        plant: the actual plant.
        simulation: a run of this plant.
        controller: controller of the run; of an intermittent one, the reaction right after every event is also
            computed, when the torque has jumped.

    Raises:
        ModelError: if the simulation is not one of this plant, or the plant has no contact with a floor at rest.
    """
    _expect_states(plant, simulation)
    ground = _Ground(plant)
    centre_at_rest, load_at_rest = ground.at_rest()
    if not (load_at_rest > 0).any():
        raise ModelError(f"{plant.path}: nothing stands on the ground at the operating point")
    events, moved = simulation.events, simulation.applied if simulation.applied.size else simulation.u
    parts = [push_bodies(ground.model, plant.linearisation.point, push) for push in simulation.pushes]
    pushes = [push for each in parts for push in each]
    column = np.repeat(np.arange(len(parts)), list(map(len, parts)))  # of `pushed`, for each of them
    table = make_table(ground.model, pushes, simulation.labels.inputs, plant.linearisation.ports.actuators)
    sizes = simulation.pushed[:, column] if parts else simulation.pushed
    centre, load = ground.contacts(simulation.x, moved, simulation.qpos, (table, sizes))
    after = slice(0, 0)
    u = np.zeros((0, moved.shape[1]))
    at = np.searchsorted(simulation.t, events.t)
    if controller and controller.observed and not simulation.delay and len(events):
        after, u = slice(None), simulation.u_after(controller)
        if not simulation.precision.get("saturated_share"):  # else the engine's own limits say what acts
            u = u + (moved - simulation.u)[at]
    qpos = simulation.qpos[at][after] if simulation.qpos.size else simulation.qpos
    pushed = sizes[at][after] if simulation.pushes else sizes
    centre_after, load_after = ground.contacts(events.x[after], u, qpos, (table, pushed))
    used = np.flatnonzero(load_at_rest + load.sum(axis=0) + load_after.sum(axis=0))
    return Pressure(
        t=simulation.t,
        centre=centre,
        at_rest=centre_at_rest,
        geoms=tuple(ground.model.geom(i).name or f"geom{i}" for i in used),
        load=load[:, used],
        load_at_rest=load_at_rest[used],
        t_after=events.t[after],
        centre_after=centre_after,
        load_after=load_after[:, used],
    )


class _Ground:
    """The ground reaction on a plant in given states (N, n) under given inputs (N, n_u).

    Positions are those of ``qpos``, shape (N, nq), where it is given and not empty.
    """

    def __init__(self, plant: MujocoPlant, level: float | None = None) -> None:
        self.model = copy(plant.model)  # its solver is set to iterate to the end meanwhile
        self.plant, self.data = plant, mujoco.MjData(self.model)
        self.moves = self.model.body_weldid[self.model.geom_bodyid] != 0
        self.level = _level(self.model) if level is None else level

    def _visit(
        self, x: Array, u: Array, qpos: Array | None, pushes: tuple[Array, Array] | None = None
    ) -> Iterator[int]:
        """Each row that can be computed, while the data are those of it."""
        model, data = self.model, self.data
        with isolate_engine(), solve_fully(model):
            for i, row in enumerate(self.plant.linearisation.ports.whole(x)):
                place(self.plant, data, row, u[i], None if qpos is None or not qpos.size else qpos[i])
                try:
                    if pushes is not None and len(pushes[0]):
                        mujoco.mj_fwdPosition(model, data)
                        data.qfrc_applied[:] = compute_forces(model, data, pushes[0], pushes[1][i])
                    mujoco.mj_forward(model, data)
                except mujoco.FatalError:  # a heap of contacts, of what fell
                    continue
                yield i

    def wrenches(self, x: Array, u: Array, qpos: Array | None = None) -> tuple[Array, Array]:
        """Force (N, 3) and centre of pressure (N, 2) that the motion of the plant's mass requires."""
        force, p = np.full((len(x), 3), np.nan), np.full((len(x), 2), np.nan)
        for i in self._visit(x, u, qpos):
            mujoco.mj_rnePostConstraint(self.model, self.data)
            force[i], p[i] = self._wrench()
        return force, p

    def weigh(self) -> tuple[float, float]:
        """The mass of all that moves [kg], and the height of its centre above the ground [m], at the operating point.

        Raises:
            ModelError: if gravity does not press it down.
        """
        force, _ = self.wrenches(*self._rest())
        if not force[0, 2] > 0:
            raise ModelError(f"{self.plant.path}: gravity does not press it down; expected a body above level ground")
        return float(self.model.body_subtreemass[0]), float(self.data.subtree_com[0, 2] - self.level)

    def contacts(
        self, x: Array, u: Array, qpos: Array | None = None, pushes: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array]:
        """Centre of pressure (N, 2) and normal force on each geom (N, n_geom), by the contact forces.

        ``pushes`` are a table of where they act (:mod:`icmj.engine.push_table`) and their sizes, shape (N, K).
        """
        centre, load = np.full((len(x), 2), np.nan), np.zeros((len(x), self.model.ngeom))
        for i in self._visit(x, u, qpos, pushes):
            centre[i], load[i] = self._contact()
        return centre, load

    def at_rest(self) -> tuple[Array, Array]:
        """Centre (2,) and load (n_geom,) at the operating point."""
        centre, load = self.contacts(*self._rest())
        return centre[0], load[0]

    def _rest(self) -> tuple[Array, Array]:
        ports = self.plant.linearisation.ports
        return np.zeros((1, len(ports.states))), np.zeros((1, len(ports.actuators)))

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

    def _contact(self) -> tuple[Array, Array]:
        load, moment, force = np.zeros(self.model.ngeom), np.zeros(2), np.zeros(6)
        for i in range(self.data.ncon):
            one, other = self.data.contact[i].geom
            if min(one, other) < 0 or self.moves[one] == self.moves[other]:
                continue
            mujoco.mj_contactForce(self.model, self.data, i, force)
            load[one if self.moves[one] else other] += force[0]
            moment += force[0] * self.data.contact[i].pos[:2]
        whole = load.sum()
        return (moment / whole if whole > 0 else np.full(2, np.nan)), load


def _level(model: mujoco.MjModel) -> float:
    """The height of the highest level plane of the world, 0 without one."""
    planes = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_bodyid == 0)
    up = [float(model.geom_pos[i, 2]) for i in np.flatnonzero(planes) if np.allclose(model.geom_quat[i, 1:3], 0)]
    return max(up, default=0.0)


def _axis(axis: str) -> int:
    if axis not in ("x", "y"):
        raise ModelError(f"no axis {axis!r}; expected x or y")
    return "xy".index(axis)


def _expect_states(plant: MujocoPlant, simulation: Simulation) -> None:
    n = len(plant.linearisation.ports.states)
    if simulation.x.shape[1] != n:
        raise ModelError(f"{plant.path}: the simulation has {simulation.x.shape[1]} states, not {n}")
