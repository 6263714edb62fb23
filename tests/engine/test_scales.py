"""Bodies of any size: what an input does is differenced over steps that fit it, and agrees with the closed form."""

import numpy as np
import pytest

from icmj.engine.plant import load_plant
from icmj.errors import ModelError
from icmj.plant.body import OperatingRule
from icmj.plant.linear_plant import Push

PENDULUM = """<mujoco model="p"><worldbody><body pos="0 0 {high}"><joint name="a" type="hinge" axis="0 1 0"/>
<inertial pos="0 0 {length}" mass="{mass}" diaginertia="{own} {own} {own}"/></body></worldbody>
<actuator><motor name="a" joint="a" gear="{gear}" {limits}/></actuator><sensor><jointpos name="a" joint="a"/></sensor>
<keyframe><key name="k" qpos="{angle}"/></keyframe></mujoco>"""


def load(path, length, angle=0.0, limits="", gear=1.0):
    """A pendulum upside down, of a person's density and shape, and its moment of inertia."""
    mass = 70 * length**3
    own = 0.05 * mass * length**2
    torque = 9.81 * mass * length
    path.write_text(PENDULUM.format(
        high=2 * length, length=length, mass=mass, own=own, angle=angle, gear=gear, limits=limits.format(torque / 5),
    ))  # fmt: skip
    rule = OperatingRule("static control" if angle else "as given")
    return load_plant(path, keyframe="k", operating=rule), mass * length**2 + own


@pytest.mark.parametrize("length", [1e-3, 3e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0])
@pytest.mark.parametrize("limits", ['ctrlrange="-{0} {0}"', 'forcerange="-{0} {0}"'])
def test_an_input_that_is_limited_has_the_effect_of_the_closed_form(tmp_path, length, limits):
    plant, inertia = load(tmp_path / "p.xml", length, limits=limits)
    assert plant.linearisation.plant.B[1, 0] * inertia == pytest.approx(1, rel=1e-9)
    assert plant.linearisation.plant.B_d[1, 0] * inertia == pytest.approx(1, rel=1e-12)
    assert plant.quality.errors[1] < 1e-9
    assert plant.quality.dead == ()
    assert not list(plant.quality.notices)


@pytest.mark.parametrize("length", [0.01, 1.0, 10.0, 12.0, 30.0, 80.0])
def test_an_input_that_holds_a_body_has_the_effect_of_the_closed_form(tmp_path, length):
    plant, inertia = load(tmp_path / "p.xml", length, angle=0.3)
    assert abs(plant.linearisation.point.ctrl[0]) == pytest.approx(9.81 * 70 * length**4 * np.sin(0.3), rel=1e-9)
    assert plant.linearisation.plant.B[1, 0] * inertia == pytest.approx(1, rel=1e-9)
    assert plant.linearisation.plant.B_d[1, 0] * inertia == pytest.approx(1, rel=1e-12)
    assert plant.quality.dead == ()


@pytest.mark.parametrize("length", [1e-3, 1e-2, 0.1, 1.0, 10.0, 1000.0])
def test_what_a_push_does_to_a_block_that_rests_on_a_floor_is_what_the_contact_leaves_of_it(tmp_path, length):
    """The contact's impedance d is the same at any depth, so that a push F accelerates a mass m by (1 − d) F/m."""
    mass, d = 70 * length**3, 0.95
    contact = f'solref="0.02 1" solimp="{d} {d} 0.001" condim="1"'
    path = tmp_path / "block.xml"
    path.write_text(f"""<mujoco><worldbody><geom type="plane" size="9 9 9" {contact}/>
<body name="block" pos="0 0 {length}"><joint name="z" type="slide" axis="0 0 1"/>
<geom type="sphere" size="{length}" mass="{mass}" {contact}/></body></worldbody>
<actuator><motor name="lift" joint="z"/></actuator><sensor><jointpos name="z" joint="z"/></sensor></mujoco>""")
    plant = load_plant(path, operating=OperatingRule("balance"))
    pushed = plant.pushed([Push(None, "block", (0.0, 0.0, 1.0))])
    for effect in (plant.linearisation.plant.B_d[:, 0], *pushed.pushes.values()):
        assert effect[1] * mass == pytest.approx(1 - d, rel=1e-8)


def test_a_control_beyond_what_the_engine_takes_is_named_and_its_way_out_works(tmp_path):
    with pytest.raises(ModelError, match=r"MuJoCo takes no control beyond 1e\+10, so give the actuator a larger gear"):
        load(tmp_path / "p.xml", 300.0, angle=0.3)
    plant, inertia = load(tmp_path / "p.xml", 300.0, angle=0.3, gear=1e9)
    assert plant.linearisation.plant.B[1, 0] * inertia == pytest.approx(1e9, rel=1e-9)


def test_at_the_end_of_its_range_a_small_motor_has_a_kink(tmp_path):
    limits = 'ctrlrange="0 {0}"'
    plant, _ = load(tmp_path / "p.xml", 0.01, limits=limits)
    assert [kink.of for kink in plant.quality.kinks] == ["a"]
