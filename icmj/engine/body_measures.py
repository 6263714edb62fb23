"""A model of shank, thigh and trunk, with or without a foot, scaled to the body measures of a person."""

from __future__ import annotations

import mujoco
import numpy as np

from icmj.engine.model_edits import lengthen, write_derived, write_inertia
from icmj.errors import ModelError
from icmj.plant.person import ANKLE_HEIGHT, SEGMENTS, Person

JOINTS = ("ankle", "knee", "hip")


def shape(spec: mujoco.MjSpec, model: mujoco.MjModel, person: Person) -> mujoco.MjModel:
    """Give the bodies ``shank``, ``thigh`` and ``trunk`` of ``spec`` the measures of ``person``, upwards along z.

    What is placed on a body (geoms, sites) grows with it. The joints ``ankle``, ``knee`` and ``hip`` get its passive
    torque. A body ``foot`` gets its mass and length; ``feet``, which is fixed, and a floor named ``floor`` only follow
    the height. ``model`` is what the spec compiles to; returns what it then compiles to.

    Raises:
        ModelError: if the model lacks one of the bodies or joints.
    """
    bodies = {body.name: body for body in spec.bodies}
    joints = {joint.name: joint for joint in spec.joints}
    missing = [f"body {b!r}" for b in SEGMENTS if b not in bodies] + [f"joint {j!r}" for j in JOINTS if j not in joints]
    if missing:
        raise ModelError(f"a person is put into a model of shank, thigh and trunk; it has no {missing[0]}")
    write_derived(spec, model)
    write_inertia(spec, model)
    names = list(SEGMENTS)
    for body, above in zip(names, (*names[1:], None), strict=True):
        known = bodies[above].pos[2] if above else bodies[body].ipos[2]
        wanted = person.length_of(body) if above else person.com_of(body)
        lengthen(bodies[body], wanted / float(known))
        bodies[body].ipos = [0, 0, person.com_of(body)]
        _weigh(bodies[body], person, body)
        if above:
            bodies[above].pos = [0, 0, person.length_of(body)]
    _stand(spec, bodies, person)
    toppling = person.toppling_stiffness(float(np.linalg.norm(spec.option.gravity)))
    for j, (joint, G) in enumerate(zip(JOINTS, toppling, strict=True)):
        joints[joint].stiffness = [person.stiffness[j] * G, *np.asarray(joints[joint].stiffness)[1:]]
        joints[joint].damping = [person.damping * G, *np.asarray(joints[joint].damping)[1:]]
    return spec.compile()


def _weigh(body: mujoco.MjsBody, person: Person, name: str) -> None:
    """Set its mass; the inertia across the plane of sway scales in proportion."""
    inertia = np.asarray(body.inertia, dtype=float)
    body.inertia = inertia * (person.inertia_of(name) / inertia[1])
    body.mass = person.mass_of(name)


def _stand(spec: mujoco.MjSpec, bodies: dict[str, mujoco.MjsBody], person: Person) -> None:
    """Feet and floor: the floor lies where the ankle's height above it is the person's."""
    floor = next((geom for geom in spec.geoms if geom.name == "floor"), None)
    if floor is None or not floor.pos[2] < 0:
        return
    factor = -ANKLE_HEIGHT * person.height / float(floor.pos[2])
    floor.pos = [floor.pos[0], floor.pos[1], -ANKLE_HEIGHT * person.height]
    for body in filter(None, map(bodies.get, ("feet", "foot"))):
        lengthen(body, factor)
    if "foot" in bodies:
        _weigh(bodies["foot"], person, "foot")
