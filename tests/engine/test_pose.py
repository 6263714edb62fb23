"""Poses against closed forms of the kinematic chain, and tangent-space magnification of rotations."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from log_cases import MODELS, made_up

from icmj import LinearPlant, MujocoPlant, Simulation, load_plant
from icmj.engine.linearisation import Linearisation
from icmj.engine.model import get_operating_point
from icmj.engine.ports import find_ports
from icmj.engine.pose import make_scene
from icmj.errors import ModelError

# the segment table of the three-link model: mass [kg], length [m], centre of mass above the lower joint [m]
SEGMENTS = ((7.44, 0.4428, 0.25107), (16.00, 0.4410, 0.25005), (54.24, 0.5184, 0.32452))


def chain(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions (N, 3, 3) and centre of mass (N, 3) of three links at angles y to the vertical."""
    up = np.stack([np.sin(y), 0 * y, np.cos(y)], axis=-1)
    joint, moment, joints = np.zeros((len(y), 3)), np.zeros((len(y), 3)), []
    for i, (mass, length, com) in enumerate(SEGMENTS):
        joints.append(joint)
        moment = moment + mass * (joint + com * up[:, i])
        joint = joint + length * up[:, i]
    return np.stack(joints, axis=1), moment / sum(mass for mass, _, _ in SEGMENTS)


def turned(simulation: Simulation, q: np.ndarray) -> Simulation:
    """The same run with other positions, as the engine would record them."""
    zero = np.zeros((len(q), 1))
    return replace(simulation, t=np.arange(len(q)) * 0.01, x=np.hstack([q, 0 * q]), y=q, u=zero, E=zero[:, 0], qpos=q)


@pytest.mark.parametrize("from_engine", [True, False])
@pytest.mark.parametrize("magnification", [1.0, 7.0])
def test_the_three_link_chain_follows_its_angles(from_engine: bool, magnification: float) -> None:
    result, plant = made_up("three_link", 0.9, 0.7594, duration=0.2)
    q = np.random.default_rng(1).uniform(-0.05, 0.05, (20, 3))
    run = turned(result.simulation, q)
    if not from_engine:
        run = replace(run, qpos=np.zeros((0, 0)))
    found = make_scene(plant, run, magnification)
    order = [found.bodies.index(name) for name in ("shank", "thigh", "trunk")]
    for factor, xpos, xquat, com in (
        (1.0, found.xpos, found.xquat, found.com),
        (magnification, found.magnified_xpos, found.magnified_xquat, found.magnified_com),
    ):
        angles = np.cumsum(factor * q, axis=1)  # joint angles are relative, segment angles absolute
        joints, centre = chain(angles)
        np.testing.assert_allclose(xpos[:, order], joints, atol=1e-12)
        np.testing.assert_allclose(com, centre, atol=1e-12)
        np.testing.assert_allclose(xquat[:, order, 0], np.cos(angles / 2), atol=1e-12)
        np.testing.assert_allclose(xquat[:, order, 2], np.sin(angles / 2), atol=1e-12)
    assert found.magnification == magnification


def test_the_person_has_all_its_shapes_and_they_are_upright() -> None:
    result, plant = made_up("three_link", 0.9, 0.7594, duration=0.1)
    found = make_scene(plant, turned(result.simulation, np.zeros((1, 3))), 10.0)
    names = {geom.name for geom in found.geoms}
    assert {"head", "chest", "thigh_left", "thigh_right", "shin_left", "heel_right", "floor"} <= names
    assert all(geom.rgba.shape == (4,) and geom.rgba.min() >= 0 and geom.rgba.max() <= 1 for geom in found.geoms)
    head = next(geom for geom in found.geoms if geom.name == "head")
    height = found.xpos[0, head.body, 2] + head.pos[2] + head.size[2] + 0.0702  # the ankle's height
    assert height == pytest.approx(1.80, abs=0.05)


FREE = """<mujoco model="free"><option gravity="0 0 0"/><worldbody>
<body name="top"><freejoint name="float"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor name="m" joint="float" gear="0 0 0 0 0 1"/></actuator>
<sensor><framepos name="p" objtype="body" objname="top"/></sensor></mujoco>"""


def test_a_rotation_is_magnified_about_its_axis() -> None:
    """A quaternion joint: ten times the sway is ten times the angle, and no geom is nothing to draw."""
    spec = mujoco.MjSpec.from_string(FREE)
    nothing = LinearPlant(np.zeros((12, 12)), np.zeros((12, 1)), np.zeros((3, 12)))
    model = spec.compile()
    linearisation = Linearisation(
        nothing, get_operating_point(model), np.zeros(3), 0.0, find_ports(model), np.zeros((3, 1))
    )
    plant = MujocoPlant(Path("free.xml"), spec, linearisation)
    angle = 0.03
    qpos = np.array([[0.01, 0.0, 0.0, np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0]])
    run = replace(made_up(duration=0.1)[0].simulation, t=np.zeros(1), x=np.zeros((1, 12)), qpos=qpos)
    found = make_scene(plant, run, 10.0)
    np.testing.assert_allclose(found.magnified_xquat[0, 1], [np.cos(0.15), 0, np.sin(0.15), 0], atol=1e-12)
    np.testing.assert_allclose(found.magnified_xpos[0, 1], [0.1, 0, 0], atol=1e-12)
    assert found.geoms == ()


def test_positions_of_another_model_are_refused() -> None:
    result, _ = made_up(duration=0.1)
    three = load_plant(MODELS / "three_link.xml", keyframe="upright")
    with pytest.raises(ModelError, match=r"three_link\.xml.*positions"):
        make_scene(three, replace(result.simulation, qpos=np.zeros((3, 1))))
    with pytest.raises(ModelError, match=r"2 states, the plant 6"):
        make_scene(three, result.simulation)
