"""Loading and deviating MJCF plants; the shipped models against their segment tables."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from model_cases import pendulum, written

from icmj import Deviation, load_plant
from icmj.engine.model import get_operating_point, load_spec, name_states
from icmj.errors import ModelError

SEGMENTS = {  # mass [kg], COM above the lower joint [m], inertia about the COM [kg m²] (Winter 2009, notes section 5)
    "shank": (7.44, 0.25107, 0.13305),
    "thigh": (16.00, 0.25005, 0.32464),
    "trunk": (54.24, 0.32452, 3.58602),
}


def test_three_link_model_has_the_segment_table(root):
    model = load_spec(root / "models" / "three_link.xml").compile()
    for name, (mass, com, inertia) in SEGMENTS.items():
        body = model.body(name)
        assert (body.mass[0], body.ipos[2], body.inertia[1]) == pytest.approx((mass, com, inertia))
    assert model.body_mass.sum() == pytest.approx(7.44 + 16.00 + 54.24)  # geoms carry nothing, the feet are fixed
    assert [model.body(b).pos[2] for b in ("thigh", "trunk")] == pytest.approx([0.4428, 0.4410])


def test_three_link_passive_torque_follows_from_the_toppling_stiffness(root):
    """G_j = g · (moment of all mass above joint j); stiffness 0, 0.8 G, 0.8 G; damping 0.005 s · G."""
    lengths = (0.4428, 0.4410)
    (m_1, c_1, _), (m_2, c_2, _), (m_3, c_3, _) = SEGMENTS.values()
    G = 9.81 * np.array(
        [
            m_1 * c_1 + m_2 * (lengths[0] + c_2) + m_3 * (sum(lengths) + c_3),
            m_2 * c_2 + m_3 * (lengths[1] + c_3),
            m_3 * c_3,
        ]
    )
    model = load_spec(root / "models" / "three_link.xml").compile()
    np.testing.assert_allclose(model.jnt_stiffness.ravel()[[0, 1, 2]], [0, 0.8 * G[1], 0.8 * G[2]], rtol=1e-6)
    np.testing.assert_allclose(model.dof_damping.ravel()[[0, 1, 2]], 0.005 * G, rtol=1e-6)


def test_segment_angles_are_sums_of_joint_angles(root):
    model = load_spec(root / "models" / "three_link.xml").compile()
    data = mujoco.MjData(model)
    data.qpos[:] = (0.3, -0.2, 0.5)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.sensordata, [0.3, 0.1, 0.6])
    # and they are the real lean of each segment: direction of its z axis
    lean = [np.arctan2(*data.body(b).xmat.reshape(3, 3)[[0, 2], 2]) for b in SEGMENTS]
    np.testing.assert_allclose(lean, data.sensordata)


def test_pendulum_is_theta_dot_dot_equals_sine_plus_torque(root):
    model = load_spec(root / "models" / "pendulum.xml").compile()
    data = mujoco.MjData(model)
    for theta, u in ((0.0, 0.7), (0.4, 0.0), (-2.0, 1.5)):
        data.qpos[0], data.ctrl[0] = theta, u
        mujoco.mj_forward(model, data)
        assert data.qacc[0] == pytest.approx(np.sin(theta) + u, abs=1e-15)


def test_gain_scales_the_inputs_and_rho_takes_a_part_of_it(root):
    path = root / "models" / "three_link.xml"
    plain = load_plant(path).linearisation.plant.B
    for gain, rho, expected in ((0.9, 1.0, [0.9] * 3), (0.9, 0.5, [0.95] * 3), ([1, 2, 3], 1.0, [1, 2, 3])):
        np.testing.assert_allclose(load_plant(path, Deviation(gain, rho=rho)).linearisation.plant.B, plain * expected)


def test_dynprm_replaces_the_actuators_parameters(root):
    spec = load_spec(root / "models" / "pendulum_neglected.xml", Deviation(dynprm={"torque": [10, 0.5]}))
    np.testing.assert_array_equal(spec.compile().actuator_dynprm[0, :2], [10, 0.5])


@pytest.mark.parametrize(
    ("deviation", "word"),
    [(Deviation([1.0, 2.0]), "2 entries"), (Deviation(dynprm={"arm": [1.0]}), "no actuator 'arm'")],
)
def test_deviation_that_does_not_fit_is_refused(root, deviation, word):
    with pytest.raises(ModelError, match=word):
        load_plant(root / "models" / "three_link.xml", deviation)


def test_unusable_files_are_named_in_one_line(tmp_path):
    with pytest.raises(ModelError, match="no such model file"):
        load_spec(tmp_path / "none.xml")
    bad = tmp_path / "bad.xml"
    bad.write_text("<mujoco><worldbody><body></worldbody></mujoco>")
    with pytest.raises(ModelError, match=r"bad\.xml: not a usable MJCF model") as caught:
        load_spec(bad)
    assert "\n" not in str(caught.value)


def test_unknown_keyframe_names_the_known_ones(root):
    model = load_spec(root / "models" / "pendulum.xml").compile()
    with pytest.raises(ModelError, match=r"no keyframe 'seated'; it has upright"):
        get_operating_point(model, "seated")


def test_states_are_named_after_joints_and_actuators(root):
    model = load_spec(root / "models" / "pendulum_neglected.xml").compile()
    assert name_states(model) == ("hinge", "hinge_rate", "torque_act0", "torque_act1")


def test_a_generated_name_is_nobody_elses(tmp_path):
    text = pendulum('<motor name="u1" joint="lean"/><motor joint="lean"/>', sensor='<jointvel joint="lean"/>')
    text = text.replace('name="angle"', 'name="y1"')
    plant = load_plant(written(tmp_path, text)).linearisation.plant
    assert (plant.inputs, plant.outputs) == (("u1", "u1_"), ("y1", "y1_"))


def test_a_model_of_opensim_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "gait2392.osim"
    path.write_text('<?xml version="1.0"?><OpenSimDocument Version="40000"><Model name="a"/></OpenSimDocument>')
    with pytest.raises(ModelError, match=r"gait2392.osim: a model of OpenSim, not MJCF; convert it, .*MyoConverter"):
        load_plant(path)
