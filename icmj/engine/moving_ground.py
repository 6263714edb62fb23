"""A motion of the surface that a model stands on, as pushes on the bodies that it carries."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from icmj.engine.model import (
    OperatingPoint,
    make_data,
)
from icmj.errors import SimulationError
from icmj.plant.linear_plant import Push, vector
from icmj.simulation.disturbance import Pushes


def push_bodies(model: mujoco.MjModel, point: OperatingPoint, push: Push) -> tuple[Push, ...]:
    """The pushes on bodies that a push is: itself, or what a motion of the surface is for each body that it carries.

    These are −m a of a translation; −m φ n × g of gravity turned by a tilt φ about n; −m φ̈ n × r and −I n φ̈ of a
    turning, with the positions r and the inertias I of the operating point.

    Raises:
        SimulationError: if a body that the surface carries has no name.
    """
    if push.surface is None:
        return (push,)
    data, axis, found = make_data(model, point), np.array(push.axis), []
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
    parts = [push_bodies(model, point, push) for push in pushes.places]
    first, size = np.cumsum([0, *map(len, parts)]), pushes.size
    of = [range(first[i], first[i + 1]) for i in range(len(parts))]
    term = np.array([i for i, at in enumerate(size.input) for _ in of[at]], dtype=int)
    each = {name: getattr(size, name)[term] for name in ("amplitude", "omega", "phase", "start", "end")}
    rows = np.array([row for at in size.input for row in of[at]], dtype=int)
    gaussian = tuple((row, noise) for at, noise in size.gaussian for row in of[at])
    return Pushes(sum(parts, ()), replace(size, n_u=int(first[-1]), input=rows, gaussian=gaussian, **each))
