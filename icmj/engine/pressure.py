"""Centre of pressure of a body that stands on a floor: where the ground's reaction acts, and what each contact bears.

It is not an output (a force jumps with the inputs, D ≠ 0) but follows from the state and the control of every row, by
the engine's own contact forces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.actuator import second_order_lag
from icmj.engine.callbacks import installed
from icmj.engine.linearisation import solved_to_the_end
from icmj.engine.plant import MujocoPlant
from icmj.errors import ModelError
from icmj.simulation.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Pressure:
    """The ground's reaction over time.

    Attributes:
        t: times of the rows [s], shape (N,).
        centre: centre of pressure (x, y) in the world [m], shape (N, 2); NaN in flight.
        at_rest: the same at the operating point, shape (2,).
        geoms: what stands on the ground.
        load: normal force on each of them [N], shape (N, G).
        load_at_rest: the same at the operating point, shape (G,).
    """

    t: Array
    centre: Array
    at_rest: Array
    geoms: tuple[str, ...]
    load: Array
    load_at_rest: Array

    def since(self, t: float) -> Pressure:
        """The rows from ``t`` on, so that a start can be left out."""
        late = self.t >= t
        return replace(self, t=self.t[late], centre=self.centre[late], load=self.load[late])

    @property
    def lifted(self) -> bool:
        """Whether something that bears load at rest bears none at some row."""
        return bool((self.load[:, self.load_at_rest > 0] <= 0).any())

    @property
    def unloading(self) -> float:
        """How far anything is unloaded: 0 at rest, 1 where it lifts off. At small sway it grows with the threshold."""
        bears = self.load_at_rest > 0
        return float((1 - self.load[:, bears] / self.load_at_rest[bears]).max(initial=0.0))


def centre_of_pressure(plant: MujocoPlant, simulation: Simulation) -> Pressure:
    """The ground's reaction at every row of ``simulation``, from either simulator.

    Raises:
        ModelError: if the simulation is not of this plant, or the plant does not stand on anything at rest.
    """
    model, ports, point = plant.model, plant.linearisation.ports, plant.linearisation.point
    if simulation.x.shape[1] != len(ports.states):
        raise ModelError(f"{plant.path}: the simulation has {simulation.x.shape[1]} states, not {len(ports.states)}")
    data, x = mujoco.MjData(model), ports.whole(simulation.x)
    moved = simulation.applied if simulation.applied.size else simulation.u
    standing = [i for i in range(model.ngeom) if model.body_weldid[model.geom_bodyid[i]] != 0]

    def reaction(qpos: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """Centre (2,) and normal force on each geom that could stand."""
        nv = model.nv
        data.qpos[:], data.qvel[:] = qpos, point.qvel + x[nv : 2 * nv]
        data.act[:], data.ctrl[:] = point.act + x[2 * nv :], point.ctrl
        data.ctrl[ports.actuators] += ports.b * u
        mujoco.mj_forward(model, data)
        load, moment, force = np.zeros(model.ngeom), np.zeros(2), np.zeros(6)
        for i in range(data.ncon):
            one, other = data.contact[i].geom
            if (one in standing) == (other in standing):
                continue
            mujoco.mj_contactForce(model, data, i, force)
            load[one if one in standing else other] += force[0]
            moment += force[0] * data.contact[i].pos[:2]
        whole = load.sum()
        return (moment / whole if whole > 0 else np.full(2, np.nan)), load

    with installed(act_dyn=second_order_lag), solved_to_the_end(model):
        at_rest, rest = reaction(point.qpos, 0 * x[0], 0 * moved[0])
        if not rest.any():
            raise ModelError(f"{plant.path}: nothing stands on the ground at the operating point")
        rows = []
        for i, row in enumerate(x):
            qpos = simulation.qpos[i] if simulation.qpos.size else point.qpos.copy()
            if not simulation.qpos.size:
                mujoco.mj_integratePos(model, qpos, np.ascontiguousarray(row[: model.nv]), 1.0)
            rows.append(reaction(qpos, row, moved[i]))
    load = np.array([loads for _, loads in rows])
    used = np.flatnonzero(rest + load.sum(axis=0))
    return Pressure(
        t=simulation.t,
        centre=np.array([centre for centre, _ in rows]),
        at_rest=at_rest,
        geoms=tuple(model.geom(i).name or f"geom{i}" for i in used),
        load=load[:, used],
        load_at_rest=rest[used],
    )
