"""Centre of pressure of a body that stands on a floor: the point of the ground reaction, and the load on each contact.

It is not an output (a force depends directly on the inputs, D ≠ 0) but is computed from the state and the control of
every row, with the contact forces of the engine.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller, has_trigger
from icmj.controller.law import Law
from icmj.engine.actuator import second_order_lag
from icmj.engine.callbacks import hushed, installed
from icmj.engine.model import solved_to_the_end
from icmj.engine.plant import MujocoPlant, place
from icmj.engine.pushing import forces, on_bodies, places
from icmj.errors import ModelError
from icmj.simulation.pressure import Pressure
from icmj.simulation.simulation import Simulation


def with_pressure(plant: MujocoPlant, controller: Law, simulation: Simulation) -> Simulation:
    """The simulation with the ground reaction if the plant stands on a floor, otherwise unchanged."""
    if not _Ground(plant).stands:
        return simulation
    known = controller if has_trigger(controller) else None
    return replace(simulation, pressure=centre_of_pressure(plant, simulation, known))


def centre_of_pressure(plant: MujocoPlant, simulation: Simulation, controller: Controller | None = None) -> Pressure:
    """The ground reaction at every row of ``simulation``, on either plant.

    Args:
        plant: the actual plant.
        simulation: a run of this plant.
        controller: controller of the run; if given, the reaction right after every event is also computed, when the
            torque has jumped.

    Raises:
        ModelError: if the simulation is not one of this plant, or the plant has no contact with a floor at rest.
    """
    n = len(plant.linearisation.ports.states)
    if simulation.x.shape[1] != n:
        raise ModelError(f"{plant.path}: the simulation has {simulation.x.shape[1]} states, not {n}")
    ground = _Ground(plant)
    if not ground.stands:
        raise ModelError(f"{plant.path}: nothing stands on the ground at the operating point")
    events, moved = simulation.events, simulation.applied if simulation.applied.size else simulation.u
    parts = [on_bodies(ground.model, plant.linearisation.point, push) for push in simulation.pushes]
    pushes = [push for each in parts for push in each]
    column = np.repeat(np.arange(len(parts)), list(map(len, parts)))  # of `pushed`, for each of them
    table = places(ground.model, pushes, simulation.labels.inputs, plant.linearisation.ports.actuators)
    sizes = simulation.pushed[:, column] if parts else simulation.pushed
    centre, load = ground.reactions(simulation.x, moved, simulation.qpos, (table, sizes))
    after = slice(0, 0)
    u = np.zeros((0, moved.shape[1]))
    at = np.searchsorted(simulation.t, events.t)
    if controller is not None and not simulation.delay and len(events):
        after, u = slice(None), simulation.u_after(controller)
        if not simulation.precision.get("saturated_share"):  # else the engine's own limits say what acts
            u = u + (moved - simulation.u)[at]
    qpos = simulation.qpos[at][after] if simulation.qpos.size else simulation.qpos
    pushed = sizes[at][after] if simulation.pushes else sizes
    centre_after, load_after = ground.reactions(events.x[after], u, qpos, (table, pushed))
    used = np.flatnonzero(ground.load + load.sum(axis=0) + load_after.sum(axis=0))
    return Pressure(
        t=simulation.t,
        centre=centre,
        at_rest=ground.centre,
        geoms=tuple(ground.model.geom(i).name or f"geom{i}" for i in used),
        load=load[:, used],
        load_at_rest=ground.load[used],
        t_after=events.t[after],
        centre_after=centre_after,
        load_after=load_after[:, used],
    )


class _Ground:
    """The ground reaction on a plant in given states under given inputs.

    Attributes:
        model: the plant's, to be read.
        centre, load: the reaction at the operating point, shapes (2,), (n_geom,).
    """

    def __init__(self, plant: MujocoPlant) -> None:
        self.model = copy(plant.model)  # its solver is set to iterate to the end meanwhile
        self.plant, self.data = plant, mujoco.MjData(self.model)
        self.moves = self.model.body_weldid[self.model.geom_bodyid] != 0
        ports = plant.linearisation.ports
        rest = self.reactions(np.zeros((1, len(ports.states))), np.zeros((1, len(ports.actuators))))
        self.centre, self.load = rest[0][0], rest[1][0]

    @property
    def stands(self) -> bool:
        """Whether anything bears load at rest."""
        return bool((self.load > 0).any())

    def reactions(
        self, x: Array, u: Array, qpos: Array | None = None, pushes: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array]:
        """Centre (N, 2) and normal force on each geom (N, n_geom), of states (N, n) and of what acts (N, n_u).

        Positions are those of ``qpos``, shape (N, nq), where it is not empty; ``pushes`` are a table of where they act
        (:mod:`icmj.engine.pushing`) and their sizes, shape (N, K).
        """
        model, data = self.model, self.data
        states = self.plant.linearisation.ports.whole(x)
        centre, load = np.full((len(x), 2), np.nan), np.zeros((len(x), model.ngeom))
        with installed(act_dyn=second_order_lag), solved_to_the_end(model), hushed():
            for i, row in enumerate(states):
                place(self.plant, data, row, u[i], None if qpos is None or not qpos.size else qpos[i])
                try:
                    if pushes is not None and len(pushes[0]):
                        mujoco.mj_fwdPosition(model, data)
                        data.qfrc_applied[:] = forces(model, data, pushes[0], pushes[1][i])
                    mujoco.mj_forward(model, data)
                except mujoco.FatalError:  # a heap of contacts, of what fell
                    continue
                centre[i], load[i] = self._reaction()
        return centre, load

    def _reaction(self) -> tuple[Array, Array]:
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
