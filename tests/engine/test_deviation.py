"""Named changes of a model against the closed form of a pendulum, and against models written out."""

import mujoco
import numpy as np
import pytest
from model_cases import MOTOR, pendulum, two, written

from icmj import Deviation, load_plant
from icmj.engine.model import load_spec
from icmj.errors import ModelError
from icmj.plant.body import Change

M, L, I, K, D, G = 70.0, 0.9, 6.0, 300.0, 4.0, 9.81
JOINT = f'stiffness="{K}" damping="{D}"'


def changed(tmp_path, *changes, rho=1.0):
    path = written(tmp_path, pendulum(MOTOR, joint=JOINT))
    return load_plant(path, Deviation(rho=rho, changes=changes)).linearisation.plant


def by_hand(m=M, l=L, I=I, k=K, d=D, g=G, armature=0.0):
    """(I + m l² + armature) θ'' = (m g l − k) θ − d θ' + u."""
    J = I + m * l**2 + armature
    return np.array([[0, 1], [(m * g * l - k) / J, -d / J]]), np.array([[0], [1 / J]])


CASES = [
    (Change("mass", "rod", 1.1), {"m": 1.1 * M, "I": 1.1 * I}),
    (Change("mass", "rod", value=60.0), {"m": 60.0, "I": I * 60 / M}),
    (Change("mass", factor=0.5), {"m": 0.5 * M, "I": 0.5 * I}),
    (Change("inertia", "rod", 1.3), {"I": 1.3 * I}),
    (Change("centre_of_mass", "rod", value=[0, 0, 1.0]), {"l": 1.0}),
    (Change("centre_of_mass", "rod", 0.9), {"l": 0.9 * L}),
    (Change("length", "rod", 1.1), {"l": 1.1 * L, "I": 1.21 * I}),
    (Change("stiffness", "lean", 0.8), {"k": 0.8 * K}),
    (Change("damping", "lean", value=9.0), {"d": 9.0}),
    (Change("armature", "lean", value=2.0), {"armature": 2.0}),
    (Change("gravity", factor=0.38), {"g": 0.38 * G}),
    (Change("gravity", value=[0, 0, -1.62]), {"g": 1.62}),
]


@pytest.mark.parametrize(("change", "expected"), CASES)
def test_a_change_is_that_of_the_closed_form(tmp_path, change, expected):
    plant = changed(tmp_path, change)
    for found, wanted in zip((plant.A, plant.B), by_hand(**expected), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-8)


def test_rho_takes_a_part_of_every_change(tmp_path):
    changes = (Change("input_gain", factor=0.8), Change("damping", "lean", value=8.0), Change("stiffness", factor=2.0))
    half = changed(tmp_path, *changes, rho=0.5)
    A, B = by_hand(d=(D + 8) / 2, k=1.5 * K)
    np.testing.assert_allclose(half.A, A, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(half.B, 0.9 * B, rtol=1e-9)
    none = changed(tmp_path, *changes, rho=0.0)
    np.testing.assert_allclose(none.A, by_hand()[0], rtol=1e-8, atol=1e-8)


def test_changes_of_one_thing_follow_each_other(tmp_path):
    plant = changed(
        tmp_path, Change("mass", "rod", 2.0), Change("inertia", "rod", 0.5), Change("input_gain", factor=3.0)
    )
    A, B = by_hand(m=2 * M)
    np.testing.assert_allclose(plant.A, A, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(plant.B, 3 * B, rtol=1e-9)


def test_inertia_from_geoms_survives_a_change_of_another_body(tmp_path):
    """Bodies whose inertia comes from their geoms keep it, and only the one that is named changes."""
    text = """<mujoco><worldbody><body name="a"><joint name="j"/>
      <geom type="capsule" fromto="0 0 0 0.1 0 1" size="0.05"/>
      <frame pos="0 0 1"><body name="b" euler="10 20 30"><joint name="k"/>
        <geom type="box" size="0.1 0.2 0.3" euler="30 20 10"/></body></frame></body></worldbody></mujoco>"""
    path = written(tmp_path, text)
    plain = load_spec(path).compile()
    model = load_spec(path, Deviation(changes=(Change("mass", "a", 2.0),))).compile()
    np.testing.assert_allclose(model.body_mass, plain.body_mass * [1, 2, 1], rtol=1e-14)
    ends = []
    for m in (plain, model):
        data = mujoco.MjData(m)
        data.qpos[:] = [0.3, -0.2]
        mujoco.mj_forward(m, data)
        full = np.zeros((m.nv, m.nv))
        mujoco.mj_fullM(m, data, full)
        ends.append(full)
    np.testing.assert_allclose(ends[1][1, 1], ends[0][1, 1], rtol=1e-14)
    longer = load_spec(path, Deviation(changes=(Change("length", "a", 2.0),))).compile()
    np.testing.assert_allclose(longer.body("b").pos, [0, 0, 2])
    np.testing.assert_allclose(longer.body("b").mass, plain.body("b").mass)
    np.testing.assert_allclose(longer.body("a").inertia, 4 * plain.body("a").inertia)


def test_actuator_parameters_change_by_name(tmp_path):
    path = two(tmp_path)
    changes = (Change("gainprm", "push", 0.7), Change("dynprm", "turn", value=[3.0, 4.0]))
    model = load_spec(path, Deviation(changes=changes)).compile()
    assert model.actuator("push").gainprm[0] == pytest.approx(0.7)
    assert model.actuator("turn").dynprm[:2] == pytest.approx([3, 4])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Change("weight", factor=1.0), "no change of 'weight'; expected one of input_gain, mass"),
        (lambda: Change("mass", "rod"), "either a factor or a value"),
        (lambda: Change("length", "rod", value=1.0), "give a factor"),
        (lambda: Change("mass", "rod", float("nan")), "finite"),
    ],
)
def test_a_change_that_is_none_is_refused(make, words):
    with pytest.raises(ModelError, match=words):
        make()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (Change("mass", "trunk", 1.1), "no body 'trunk' to change; it has rod"),
        (Change("damping", "knee", 1.1), "no joint, tendon or actuator 'knee' to change; it has lean, ankle"),
        (Change("input_gain", "knee", 1.1), "no actuator 'knee' to change; it has ankle"),
        (Change("sensor_gain", "knee", 1.1), "no sensor 'knee' to change; it has angle"),
        (Change("sensor_gain", "angle", 0.0), "gain of 0"),
        (Change("centre_of_mass", "rod", value=[1, 2, 3, 4]), "4 numbers for a property of 3"),
        (Change("mass", "rod", -1.0), "does not compile"),
    ],
)
def test_a_change_that_does_not_fit_the_model_is_one_line(tmp_path, change, words):
    with pytest.raises(ModelError, match=words) as caught:
        changed(tmp_path, change)
    assert "\n" not in str(caught.value)


TENDON = """<mujoco><compiler angle="radian"/><worldbody>
  <body><joint axis="0 1 0" stiffness="3" damping="0.2"/><inertial pos="0 0 0.9" mass="70" diaginertia="6 6 1"/>
    <body pos="0 0 1"><joint axis="0 1 0" stiffness="5" damping="0.3" armature="0.4"/>
      <inertial pos="0 0 0.3" mass="20" diaginertia="2 2 1"/></body></body></worldbody>
  <tendon><fixed name="calf" stiffness="7" damping="0.5" armature="0.2">
    <joint joint="{joint}" coef="1"/></fixed></tendon>
  <actuator><motor name="m" tendon="calf" damping="0.6" armature="0.1"/></actuator></mujoco>"""


@pytest.mark.parametrize("what", ["stiffness", "damping", "armature"])
def test_a_factor_without_a_name_is_for_tendons_too(tmp_path, what):
    """All that have the property: joints, of which none has a name here but one, a tendon, an actuator."""
    text = TENDON.replace("<joint axis", '<joint name="ankle" axis', 1).format(joint="ankle")
    path = written(tmp_path, text)
    before, after = load_spec(path).compile(), load_spec(path, Deviation(changes=(Change(what, factor=2.0),))).compile()
    kinds = {"stiffness": ("jnt", "tendon"), "damping": ("dof", "tendon", "actuator")}
    for kind in kinds.get(what, ("dof", "tendon", "actuator")):
        old, new = (getattr(model, f"{kind}_{what}") for model in (before, after))
        assert old.any(), kind
        np.testing.assert_array_equal(new, 2 * old)
    named = load_spec(path, Deviation(changes=(Change(what, "calf", value=9.0),))).compile()
    assert getattr(named, f"tendon_{what}").ravel()[0] == 9.0
    every = load_spec(path, Deviation(changes=(Change(what, value=9.0),))).compile()
    assert (getattr(every, "jnt_stiffness" if what == "stiffness" else f"dof_{what}") == 9.0).all()
    np.testing.assert_array_equal(getattr(every, f"tendon_{what}"), getattr(before, f"tendon_{what}"))


def test_a_change_of_mass_without_a_name_is_for_bodies_without_one_too(tmp_path):
    path = written(tmp_path, TENDON.replace("<joint axis", '<joint name="ankle" axis', 1).format(joint="ankle"))
    model = load_spec(path, Deviation(changes=(Change("mass", factor=2.0),))).compile()
    np.testing.assert_allclose(model.body_mass, [0, 140, 40])
