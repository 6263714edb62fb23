"""A model in a vertical plane as a tree of links, which moves without the engine.

Every degree of freedom is a link: a hinge about an axis across the plane, or a slide along it. In departures (q, v, a)
from the operating point, with a the activations of its actuators,

    M(q) q̈ + h(q, v) = τ_0 − K q − D v + T_a a + T_u b u,      ȧ = A_q q + A_v v + A_a a + B_a b u

where M and h follow from joints, masses, centres and moments of inertia. Whether that is all that moves the model is
not looked up in a list of features: the engine itself is asked for its accelerations at a few states.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.dynamics import Dynamics
from icmj.engine.isolation import isolate_engine
from icmj.engine.plant import MujocoPlant
from icmj.engine.pose import pose_departures
from icmj.engine.stages import is_flow, may_constrain
from icmj.simulation.scene import Scene

_STATES, _WIDE = 8, 0.3  # states at which the engine is asked, and how far their positions depart [rad or m]
_SAME = 1e-9  # relative difference of accelerations: rounding of two ways to solve for them is 1e-13


@dataclass(frozen=True, eq=False)
class Chain:
    """Links of a planar model at its operating point, n of them; vectors are (x, z) in the world.

    Attributes:
        parent: link on which each is mounted, −1 for the world; shape (n,).
        turn: sense of each hinge about +y, 0 for a slide; shape (n,).
        axis: direction of each slide, zero for a hinge; shape (n, 2).
        joint: from the parent's joint, or the world's origin, to the link's joint [m]; shape (n, 2).
        centre: from the joint to the centre of mass [m]; shape (n, 2).
        mass, inertia, armature: m [kg], moment of inertia about the centre of mass [kg m²], rotor inertia; shape (n,).
        gravity: g [m/s²]; shape (2,).
        stiffness, damping: K and D of the joints; shape (n,).
        T_a, T_u: generalised forces of activations and of inputs with the gain b = 1; shapes (n, n_a), (n, n_u).
        rates: of the activations, from (q, v, a, b u); shape (n_a, 2n + n_a + n_u).
        link: of each body, −1 for one that does not move; shape (bodies,).
        scene: bodies and geoms at the operating point, one frame.
    """

    parent: np.ndarray
    turn: Array
    axis: Array
    joint: Array
    centre: Array
    mass: Array
    inertia: Array
    armature: Array
    gravity: Array
    stiffness: Array
    damping: Array
    T_a: Array
    T_u: Array
    rates: Array
    link: np.ndarray
    scene: Scene

    def __call__(self, x: Array, u: Array) -> Array:
        """ẋ at departures x = (q, v, a) and inputs b u; shape (2n + n_a,)."""
        n = len(self.parent)
        q, v, a = np.split(x, [n, 2 * n])
        angle, omega = np.zeros(n), np.zeros(n)
        place, drift, centre, pull = (np.zeros((n, 2)) for _ in range(4))
        moves = np.zeros((n, n, 3))  # of link k's centre and angle by degree of freedom j
        for i, p in enumerate(self.parent):
            there = (0.0, 0.0, np.zeros(2), np.zeros(2)) if p < 0 else (angle[p], omega[p], place[p], drift[p])
            turned, spin, at, bent = there
            angle[i], omega[i] = turned + self.turn[i] * q[i], spin + self.turn[i] * v[i]
            arm, along = _turn(turned, self.joint[i] + self.axis[i] * q[i]), _turn(turned, self.axis[i])
            place[i] = at + arm
            drift[i] = bent - spin**2 * arm + 2 * spin * v[i] * np.array([along[1], -along[0]])
            reach = _turn(angle[i], self.centre[i])
            centre[i], pull[i] = place[i] + reach, drift[i] - omega[i] ** 2 * reach - self.gravity
            moves[:, i] = 0 if p < 0 else moves[:, p]
            moves[i, i] = *along, self.turn[i]
        for k in range(n):
            for j in range(n):
                if self.turn[j] and moves[j, k, 2]:
                    lever = centre[k] - place[j]
                    moves[j, k, :2] = self.turn[j] * np.array([lever[1], -lever[0]])
        weight = np.column_stack([self.mass, self.mass, self.inertia])
        M = np.einsum("jkc,lkc,kc->jl", moves, moves, weight) + np.diag(self.armature)
        h = np.einsum("jkc,kc,k->j", moves[:, :, :2], pull, self.mass)
        force = self.T_a @ a + self.T_u @ u - self.stiffness * q - self.damping * v + self._weight()
        return np.concatenate([v, np.linalg.solve(M, force - h), self.rates @ np.concatenate([x, u])])

    def _weight(self) -> Array:
        """τ_0, which holds the links at the operating point; shape (n,)."""
        held, place = np.zeros(len(self.parent)), np.zeros((len(self.parent), 2))
        for k, p in enumerate(self.parent):
            place[k] = self.joint[k] + (place[p] if p >= 0 else 0)
            j = k
            while j >= 0:
                lever = place[k] + self.centre[k] - place[j]
                way = self.turn[j] * np.array([lever[1], -lever[0]]) if self.turn[j] else self.axis[j]
                held[j] -= self.mass[k] * way @ self.gravity
                j = int(self.parent[j])
        return held


@isolate_engine()
def find_chain(plant: MujocoPlant) -> tuple[Chain | None, str]:
    """The links of a model, if it is planar, and why they do not move as the engine moves it; "" where they do."""
    model, point = plant.model, plant.linearisation.point
    joints = np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
    if not joints.all():
        return None, "it has a free or ball joint"
    data = mujoco.MjData(model)
    data.qpos[:] = point.qpos
    mujoco.mj_forward(model, data)
    hinge = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    across = np.abs(data.xaxis[:, 1])
    if not np.allclose(across, hinge, atol=1e-12) or abs(model.opt.gravity[1]) > 1e-12:
        return None, "its joints do not move in the vertical plane of x and z"
    found = _links(plant, data, hinge)
    ports = plant.linearisation.ports
    if not np.array_equal(ports.states, np.arange(ports.size)):
        return found, "some of its states are left out or in another order"
    if not is_flow(model) or may_constrain(model):
        return found, "contacts, limits, friction losses or equalities may act in it"
    return found, "" if _same(plant, found) else "more acts in it than links, weight, springs, dampers and motors"


def _links(plant: MujocoPlant, data: mujoco.MjData, hinge: np.ndarray) -> Chain:
    model, n, here = plant.model, plant.model.nv, plant.linearisation
    link, parent = np.full(model.nbody, -1), np.full(n, -1)
    for body in range(1, model.nbody):
        link[body] = link[model.body_parentid[body]]
        for i in range(model.body_dofadr[body], model.body_dofadr[body] + model.body_dofnum[body]):
            link[body], parent[i] = i, link[body]
    turn, plane = np.where(hinge, np.sign(data.xaxis[:, 1]), 0.0), data.xanchor[:, ::2]
    mass, centre, inertia = np.zeros(n), plane.copy(), np.zeros(n)
    for i in range(n):
        of = np.flatnonzero((link == i) & (model.body_mass > 0))
        if not len(of):
            continue
        mass[i] = model.body_mass[of].sum()
        centre[i] = model.body_mass[of] @ data.xipos[of][:, ::2] / mass[i]
        axes = data.ximat[of].reshape(-1, 3, 3)[:, 1]  # of y in the principal axes of each body
        spread = ((data.xipos[of][:, ::2] - centre[i]) ** 2).sum(axis=1)
        inertia[i] = float((axes**2 * model.body_inertia[of]).sum() + model.body_mass[of] @ spread)
    beneath = np.where(parent[:, None] >= 0, plane[parent], 0.0)
    T_u, T_a, rates = _forces(plant)
    return Chain(
        parent=parent, turn=turn, axis=np.where(hinge[:, None], 0.0, data.xaxis[:, ::2]), joint=plane - beneath,
        centre=centre - plane, mass=mass, inertia=inertia, armature=model.dof_armature.copy(),
        gravity=model.opt.gravity[::2].copy(), stiffness=model.jnt_stiffness.reshape(n, -1)[:, 0].copy(),
        damping=model.dof_damping.reshape(n, -1)[:, 0].copy(), T_a=T_a, T_u=T_u / here.ports.b, rates=rates, link=link,
        scene=pose_departures(plant, np.zeros(1), np.zeros((1, n))),
    )  # fmt: skip


def _forces(plant: MujocoPlant) -> tuple[Array, Array, Array]:
    """T_u b, T_a, and the rates of the activations, from what one unit of each changes in the engine."""
    dynamics, linear, nv = Dynamics(plant), plant.linearisation, plant.model.nv
    n, n_u = linear.ports.size, linear.plant.n_u
    if n != len(linear.ports.states):
        return np.zeros((nv, n_u)), np.zeros((nv, n - 2 * nv)), np.zeros((n - 2 * nv, n + n_u))

    def ask_engine(x: Array, u: Array) -> tuple[Array, Array]:
        rate = dynamics(x, u)[0]
        return dynamics.data.qfrc_actuator.copy(), rate[2 * nv :]

    rest = ask_engine(np.zeros(n), np.zeros(n_u))
    states = [ask_engine(e, np.zeros(n_u)) for e in np.eye(n)]
    inputs = [ask_engine(np.zeros(n), e) for e in np.eye(n_u)]
    force = np.column_stack([found[0] - rest[0] for found in (*states[2 * nv :], *inputs)])
    rates = np.column_stack([found[1] - rest[1] for found in (*states, *inputs)])
    rates[:, n:] /= linear.ports.b
    return force[:, n - 2 * nv :], force[:, : n - 2 * nv], rates


def _same(plant: MujocoPlant, chain: Chain) -> bool:
    """Whether the links move as the engine moves the model, at a few states."""
    dynamics, here, random = Dynamics(plant), plant.linearisation, np.random.default_rng(0)
    size = 1 / np.maximum(np.abs(here.plant.B).max(), 1e-12)
    for _ in range(_STATES):
        x = _WIDE * random.uniform(-1, 1, here.ports.size)
        x[2 * plant.model.nv :] *= size
        u = size * random.uniform(-1, 1, here.plant.n_u)
        rate, y = dynamics(x, u)
        found = chain(x, here.ports.b * u)
        if not np.abs(found - rate).max() <= _SAME * np.abs(rate).max():
            return False
        if not np.abs(here.plant.C @ x - y).max() <= _SAME * (np.abs(here.plant.C) @ np.abs(x)).max():
            return False
    return True


def _turn(angle: float, vector: Array) -> Array:
    """``vector`` turned about +y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])
