"""The moving body for display: poses at every row of a simulation, true and with the sway magnified."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.plant import MujocoPlant
from icmj.errors import ModelError
from icmj.simulation.scene import Geom, Scene
from icmj.simulation.simulation import Simulation

SHAPES = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box")  # what the replay can draw; others are left out


def make_scene(
    plant: MujocoPlant, simulation: Simulation, magnification: float = 10.0, rows: np.ndarray | None = None
) -> Scene:
    """Poses of ``plant``'s bodies at every sample of ``simulation``, or at some.

    A MuJoCo simulation carries its positions; for a linear one they are the operating point moved by the
    position states. In the magnified figure every departure from the operating point, in the tangent space of the
    positions, is ``magnification`` times as large.

    Args:
        plant: the plant.
        simulation: a run of it.
        magnification: of the second figure's sway.
        rows: indices of the samples, such as :func:`icmj.simulation.scene.select_frames` gives; all if ``None``.

    Raises:
        ModelError: if the simulation is not of this plant.
    """
    model = plant.model
    nv, shown = model.nv, np.arange(len(simulation.t)) if rows is None else rows
    if simulation.qpos.size:
        if simulation.qpos.shape != (len(simulation.t), model.nq):
            raise ModelError(
                f"{plant.path}: the simulation's positions have shape {simulation.qpos.shape}; "
                f"this model needs {(len(simulation.t), model.nq)}"
            )
        departure = measure_departures(plant, simulation.qpos[shown])
    else:
        ports = plant.linearisation.ports
        if simulation.x.shape[1] != len(ports.states):
            raise ModelError(
                f"{plant.path}: the simulation has {simulation.x.shape[1]} states, the plant {len(ports.states)}"
            )
        departure = ports.whole(simulation.x[shown])[:, :nv]
    found, followed = pose_departures(plant, simulation.t[shown], departure, magnification), simulation.setpoint
    if followed is None or len(followed.x_ss) != len(plant.linearisation.ports.states):
        return found
    wanted = plant.linearisation.ports.whole(simulation.r[shown] @ followed.x_ss.T)[:, :nv]
    return replace(found, target=_skeleton(plant, wanted), magnified_target=_skeleton(plant, magnification * wanted))


def pose_departures(plant: MujocoPlant, t: Array, departure: Array, magnification: float = 10.0) -> Scene:
    """Poses at departures of the positions from the operating point, in their tangent space, shapes (N,), (N, nv)."""
    model, qpos_0 = plant.model, plant.linearisation.point.qpos
    xpos, xquat, com = _poses(model, qpos_0, departure)
    return Scene(
        t,
        tuple(model.body(i).name or f"body{i}" for i in range(model.nbody)),
        _geoms(model),
        xpos,
        xquat,
        com,
        *_poses(model, qpos_0, magnification * departure),
        magnification=float(magnification),
    )


def measure_departures(plant: MujocoPlant, qpos: Array) -> Array:
    """Departures of MuJoCo's positions from the operating point, in their tangent space; (N, nq) → (N, nv)."""
    departure = np.zeros((len(qpos), plant.model.nv))
    for dq, position in zip(departure, qpos, strict=True):
        mujoco.mj_differentiatePos(plant.model, dq, 1.0, plant.linearisation.point.qpos, position)
    return departure


def _poses(model: mujoco.MjModel, qpos_0: Array, departure: Array) -> tuple[Array, Array, Array]:
    """Body positions (N, nb, 3) and orientations (N, nb, 4), and the whole body's centre of mass (N, 3)."""
    N = len(departure)
    xpos, xquat, com = np.zeros((N, model.nbody, 3)), np.zeros((N, model.nbody, 4)), np.zeros((N, 3))
    for i, data in enumerate(_visit(model, qpos_0, departure)):
        mujoco.mj_comPos(model, data)
        xpos[i], xquat[i], com[i] = data.xpos, data.xquat, data.subtree_com[0]
    return xpos, xquat, com


def _visit(model: mujoco.MjModel, qpos_0: Array, departure: Array) -> Iterator[mujoco.MjData]:
    """The same data at the kinematics of each departure in turn."""
    data = mujoco.MjData(model)
    for dq in departure:
        data.qpos[:] = qpos_0
        mujoco.mj_integratePos(model, data.qpos, dq, 1.0)
        mujoco.mj_kinematics(model, data)
        yield data


def _skeleton(plant: MujocoPlant, departure: Array) -> Array:
    """Lines from each moving body to its children, and from one without children through its centre of mass, twice as
    far as that is; shape (N, M, 2, 3)."""
    model = plant.model
    moving = [body for body in range(1, model.nbody) if model.body_weldid[body] != 0]
    bones = [(int(model.body_parentid[body]), body) for body in moving if model.body_parentid[body] in moving]
    tips = [body for body in moving if body not in {parent for parent, _ in bones}]
    lines = np.zeros((len(departure), len(bones) + len(tips), 2, 3))
    for line, data in zip(lines, _visit(model, plant.linearisation.point.qpos, departure), strict=True):
        line[: len(bones)] = data.xpos[np.array(bones, dtype=int).reshape(-1, 2)]
        line[len(bones) :, 0] = data.xpos[tips]
        line[len(bones) :, 1] = 2 * data.xipos[tips] - data.xpos[tips]
    return lines


def _geoms(model: mujoco.MjModel) -> tuple[Geom, ...]:
    """The geoms a person sees: the groups that MuJoCo's own viewer shows, of the shapes in ``SHAPES``."""
    kinds = {int(getattr(mujoco.mjtGeom, f"mjGEOM_{shape.upper()}")): shape for shape in SHAPES}
    return tuple(
        Geom(
            model.geom(i).name or f"geom{i}",
            int(model.geom_bodyid[i]),
            kinds[int(model.geom_type[i])],
            model.geom_size[i].copy(),
            model.geom_pos[i].copy(),
            model.geom_quat[i].copy(),
            model.geom_rgba[i].astype(float),
        )
        for i in range(model.ngeom)
        if int(model.geom_type[i]) in kinds and model.geom_group[i] <= 2 and model.geom_rgba[i, 3] > 0
    )
