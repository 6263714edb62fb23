"""Masses and lengths of the bodies of a model that is not compiled yet."""

from __future__ import annotations

import mujoco
import numpy as np


def frozen(spec: mujoco.MjSpec) -> None:
    """Write the compiled inertia into every body, so that it can be changed independently of its geoms."""
    model = spec.copy().compile()
    for body in spec.bodies:
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body.name) if body.name else int(body.id)
        if index <= 0 or not model.body_mass[index] > 0:
            continue
        body.explicitinertial = True
        body.mass, body.inertia = float(model.body_mass[index]), model.body_inertia[index]
        body.ipos, body.iquat = model.body_ipos[index], model.body_iquat[index]
        body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
        body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.compiler.settotalmass = -1


def lengthened(body: mujoco.MjsBody, factor: float) -> None:
    """Scale everything placed in the body's frame about its origin; the mass stays, inertia scales with the square."""
    for thing in (*body.bodies, *body.joints, *body.sites, *body.frames, *body.cameras, *body.lights):
        thing.pos = np.asarray(thing.pos) * factor
    for item in (*body.geoms, *body.sites):
        item.size = np.asarray(item.size) * factor
        item.fromto = np.asarray(item.fromto) * factor
    for geom in body.geoms:
        geom.pos = np.asarray(geom.pos) * factor
    if body.mass > 0:
        body.ipos = np.asarray(body.ipos) * factor
        body.inertia = np.asarray(body.inertia) * factor**2
