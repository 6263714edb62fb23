"""Linearisation against closed forms, the mass matrix, the poles in the notes, and its order of convergence."""

import mujoco
import numpy as np
import pytest

from icmj.engine.linearisation import linearise
from icmj.engine.model import load_spec
from icmj.errors import ModelError


def model_of(root, name):
    return load_spec(root / "models" / f"{name}.xml").compile()


def test_pendulum_is_one_over_s_squared_minus_one(root):
    plant = linearise(model_of(root, "pendulum"), "upright").plant
    np.testing.assert_allclose(plant.A, [[0, 1], [1, 0]], atol=1e-10)
    np.testing.assert_allclose(plant.B, [[0], [1]], atol=1e-10)
    np.testing.assert_allclose(plant.C, [[1, 0]], atol=1e-10)


def test_neglected_dynamics_have_the_actuators_transfer_function(root):
    plant = linearise(model_of(root, "pendulum_neglected"), "upright").plant
    s = 0.7 + 3j
    expected = 100 / (s**2 + 2 * 0.1 * 10 * s + 100) / (s**2 - 1)
    found = plant.C @ np.linalg.solve(s * np.eye(plant.n) - plant.A, plant.B)
    assert found[0, 0] == pytest.approx(expected, rel=1e-9)


def test_three_link_poles_are_those_of_the_notes(root):
    poles = linearise(model_of(root, "three_link"), "upright").plant.poles
    np.testing.assert_allclose(np.sort(poles.real), [-5.198, -5.198, -3.459, -2.422, 2.191, 3.106], atol=6e-4)
    assert poles.imag.max() == pytest.approx(28.288, abs=6e-4)


def test_three_link_without_passive_torque_has_the_poles_of_the_notes(root):
    spec = load_spec(root / "models" / "three_link.xml")
    for joint in spec.joints:
        joint.stiffness, joint.damping = np.zeros(3), np.zeros(3)
    poles = np.sort(linearise(spec.compile()).plant.poles.real)
    np.testing.assert_allclose(poles, [-21.611, -7.295, -2.878, 2.878, 7.295, 21.611], atol=6e-4)


def test_input_matrix_is_the_inverse_mass_matrix_times_gear(root):
    model = model_of(root, "three_link")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    M = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, M)
    B = linearise(model).plant.B
    np.testing.assert_allclose(B[3:], np.linalg.inv(M), rtol=1e-8)
    np.testing.assert_array_equal(B[:3], 0)


def test_centred_differences_are_of_second_order(root):
    """Away from the upright position the error falls with eps² (at it, odd symmetry hides the order)."""
    model = model_of(root, "pendulum")
    model.key_qpos[0, 0] = theta = 0.8
    errors = [abs(linearise(model, "upright", eps).plant.A[1, 0] - np.cos(theta)) for eps in (1e-1, 1e-2)]
    assert np.log10(errors[0] / errors[1]) == pytest.approx(2, abs=0.01)


def test_default_step_is_right_to_two_parts_in_a_billion(root):
    model = model_of(root, "three_link")
    fine = [linearise(model, eps=eps).plant.A for eps in (1e-3, 2e-3)]
    richardson = (4 * fine[0] - fine[1]) / 3  # fourth order, large steps: little rounding
    A = linearise(model).plant.A
    assert np.abs(A - richardson).max() / np.abs(A).max() < 2e-9


def test_quaternion_joints_are_differentiated_in_the_tangent_space():
    """A free body with a motor along x: twelve states, tilted start, x'' = u/m in the world."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0"/><worldbody><body quat="0.5 0.5 0.5 0.5"><freejoint name="root"/>
        <geom type="box" size="0.1 0.2 0.3" mass="2"/><site name="s"/></body></worldbody>
        <actuator><motor site="s" refsite="s" gear="1 0 0 0 0 0" name="push"/></actuator>
        <sensor><framepos objtype="site" objname="s"/></sensor></mujoco>"""
    )
    plant = linearise(model).plant
    assert plant.n == 12
    np.testing.assert_allclose(plant.A[:6, 6:], np.eye(6), atol=1e-12)
    np.testing.assert_allclose(plant.A[6:], 0, atol=1e-9)
    np.testing.assert_allclose(plant.C[:, :3], np.eye(3), atol=1e-10)


BALL = """
<mujoco model="ball">
  <option timestep="{step}" integrator="RK4"/>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 1" condim="1" {touch}/>
    <body name="ball" pos="0 0 0.1"><freejoint name="free"/>
      <geom name="skin" size="0.1" mass="2" condim="1" {touch}/></body>
  </worldbody>
  <actuator><general name="lift" joint="free" gear="0 0 1 0 0 0"/></actuator>
  <sensor><framepos name="place" objtype="body" objname="ball"/></sensor>
  <keyframe><key name="lies" qpos="0 0 {height} 1 0 0 0"/></keyframe>
</mujoco>"""


@pytest.mark.parametrize("constant", [2e-2, 2e-3, 2e-4, 5e-5])
def test_however_little_a_body_sinks_in_the_slope_is_that_of_the_contact(constant):
    """Of impedance d: z̈ = −(1 − d) g − (2/T) ż − r/T², so r = −(1 − d) g T² at rest: 2.5 nm to 0.4 mm."""
    touch, depth = f'solref="{constant} 1" solimp="0.9 0.9 0.001"', 0.1 * 9.81 * constant**2
    text = BALL.format(step=constant / 2, touch=touch, height=repr(0.1 - depth))
    found = linearise(mujoco.MjModel.from_xml_string(text), "lies")
    assert found.residual < 1e-4
    np.testing.assert_allclose(found.plant.A[8, 2], -1 / constant**2, rtol=1e-5)
    np.testing.assert_allclose(found.plant.A[8, 8], -2 / constant, rtol=1e-5)


def test_residual_tells_that_a_point_is_no_equilibrium(root):
    model = model_of(root, "pendulum")
    assert linearise(model, "upright").residual == 0
    model.key_qpos[0, 0] = 0.3
    assert linearise(model, "upright").residual == pytest.approx(np.sin(0.3))


@pytest.mark.parametrize(("part", "word"), [("actuator", "no actuator"), ("sensor", "no sensor")])
def test_model_without_inputs_or_outputs_is_refused(part, word):
    other = {
        "actuator": '<sensor><jointpos joint="j"/></sensor>',
        "sensor": '<actuator><motor joint="j"/></actuator>',
    }[part]
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><joint name="j"/><geom size="0.1"/></body></worldbody>{other}</mujoco>'
    )
    with pytest.raises(ModelError, match=word):
        linearise(model)


def test_user_dynamics_that_are_not_known_are_refused():
    """Their activations would stand still in the linear model without a word."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="j"/><geom size="0.1"/></body></worldbody>
        <actuator><general name="muscle" joint="j" dyntype="user" actdim="3" dynprm="1"/></actuator>
        <sensor><jointpos joint="j"/></sensor></mujoco>"""
    )
    with pytest.raises(ModelError, match="actuator 'muscle' has user activation dynamics"):
        linearise(model)
