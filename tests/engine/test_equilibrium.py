"""Equilibria against closed forms: torques of a lean, a balanced lean, shared effort, weights on a floor."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from model_cases import BIASED, MOTOR, MUSCLE, SERVO, pendulum, written
from scipy.optimize import minimize_scalar

from icmj import Deviation, load_plant
from icmj.errors import ModelError
from icmj.plant.body import Change, OperatingRule

STATIC, BALANCE = OperatingRule("static control"), OperatingRule("balance")
LEAN, WEIGHT = np.radians(3), 70 * 9.81
TORQUE = -WEIGHT * 0.9 * np.sin(LEAN)


def found(tmp_path, text, rule=STATIC, deviation=None):
    plant = load_plant(written(tmp_path, text), deviation, "stand", operating=rule)
    assert plant.quality.at_rest, plant.quality.residual
    return plant.linearisation.point


@pytest.mark.parametrize(
    ("actuator", "ctrl"),
    [(MOTOR, TORQUE), (SERVO, LEAN + TORQUE / 400), (BIASED, (TORQUE - 5 + 30 * LEAN) / 2)],
)
def test_static_control_holds_a_lean(tmp_path, actuator, ctrl):
    point = found(tmp_path, pendulum(actuator, key=f'qpos="{LEAN}"'))
    assert point.ctrl[0] == pytest.approx(ctrl, rel=1e-9)
    assert point.qpos[0] == LEAN


def test_a_muscle_holds_a_lean_by_its_activation(tmp_path):
    point = found(tmp_path, pendulum(MUSCLE, key=f'qpos="{-LEAN}"'))
    assert 0 < point.ctrl[0] < 1
    assert point.act[0] == pytest.approx(point.ctrl[0], rel=1e-6)


def test_effort_is_shared_so_that_its_square_is_least(tmp_path):
    """Two motors on one joint, the second with twice the lever: each gives half the torque."""
    pair = MOTOR + '<motor name="other" joint="lean" gear="2"/>'
    point = found(tmp_path, pendulum(pair, key=f'qpos="{LEAN}"'))
    np.testing.assert_allclose(point.ctrl, [TORQUE / 2, TORQUE / 4], rtol=1e-7)
    # where controls are given, they change as little as they can
    point = found(tmp_path, pendulum(pair, key=f'qpos="{LEAN}" ctrl="7 3"'))
    missing = TORQUE - 7 - 2 * 3
    np.testing.assert_allclose(point.ctrl, [7 + missing / 2, 3 + missing / 4], rtol=1e-7)


def test_a_pose_that_may_move_balances_the_weight(tmp_path):
    """A centre of mass 5 cm in front of the hinge: least effort is a lean back until it is above."""
    text = pendulum(MOTOR, key=f'qpos="{LEAN}"').replace('pos="0 0 0.9"', 'pos="0.05 0 0.9"')
    point = found(tmp_path, text, BALANCE)
    assert point.qpos[0] == pytest.approx(-np.arctan(0.05 / 0.9), abs=1e-5)
    assert abs(point.ctrl[0]) < 1e-2


def test_an_unactuated_joint_finds_its_place_and_the_others_stay(root):
    """The three-link with a heavier trunk in front: only the ankle moves, the others are held by torque."""
    heavy = Deviation(changes=(Change("centre_of_mass", "trunk", value=[0.03, 0, 0.32452]),))
    path = root / "models" / "three_link.xml"
    plant = load_plant(path, heavy, "upright", operating=OperatingRule("balance", ("ankle",)))
    q = plant.linearisation.point.qpos
    np.testing.assert_array_equal(q[1:], 0)
    assert plant.quality.at_rest
    model = plant.spec.compile()
    data = mujoco.MjData(model)

    def effort(ankle):
        data.qpos[:] = [ankle, 0, 0]
        mujoco.mj_inverse(model, data)
        return np.sum(data.qfrc_inverse**2)

    assert q[0] == pytest.approx(minimize_scalar(effort, (-0.1, 0), tol=1e-12).x, abs=1e-5)
    assert q[0] < -0.01


def test_what_cannot_be_held_is_named(tmp_path):
    idle = '<body name="arm" pos="0 0 1.5"><joint name="elbow" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/></body>'
    with pytest.raises(ModelError, match=r"cannot be held at rest.*: on elbow 12.3 N m are missing"):
        found(tmp_path, pendulum(MOTOR, body=idle, key='qpos="0 0"'))
    weak = '<motor name="ankle" joint="lean" ctrllimited="true" ctrlrange="-20 20"/>'
    with pytest.raises(ModelError, match=r"on lean 12.3 N m are missing; ankle at the end of its range"):
        found(tmp_path, pendulum(weak, key=f'qpos="{LEAN}"'))
    with pytest.raises(ModelError, match="no joint 'knee' to free; it has lean"):
        found(tmp_path, pendulum(MOTOR), OperatingRule("balance", ("knee",)))


FLOOR = """
<mujoco model="standing">
  <option timestep="0.001" integrator="RK4"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1"/>
    <body name="foot" pos="0 0 0.06"><freejoint name="root"/>
      <geom type="box" size="0.12 0.1 0.03" mass="2"/>
      <body name="rod" pos="0 0 0.03"><joint name="ankle" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0.2 0 0 1.6" size="0.05" mass="60" contype="0" conaffinity="0"/></body></body>
  </worldbody>
  <actuator><motor name="torque" joint="ankle"/></actuator>
  <sensor><jointpos name="angle" joint="ankle"/></sensor>
  <keyframe><key name="stand" qpos="0 0 0.06 1 0 0 0 {lean}"/></keyframe>
</mujoco>"""


@pytest.mark.parametrize("lean", [0.0, 0.02])
def test_a_foot_on_the_floor_bears_the_weight(tmp_path, lean):
    """The foot is set down from 3 cm above; contact forces carry the whole weight and the torque of the lean."""
    plant = load_plant(
        written(tmp_path, FLOOR.format(lean=lean)), None, "stand", operating=OperatingRule("balance", ("root",))
    )
    point, model = plant.linearisation.point, plant.spec.compile()
    assert plant.quality.residual.share < 1e-6
    assert point.qpos[2] == pytest.approx(0.03, abs=2e-3)
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = point.qpos, point.ctrl
    mujoco.mj_forward(model, data)
    assert data.qfrc_constraint[2] == pytest.approx(62 * 9.81, rel=1e-5)
    lever = data.body("rod").xipos[0] - data.body("rod").xpos[0]
    assert point.ctrl[0] == pytest.approx(-60 * 9.81 * lever, rel=1e-5, abs=1e-6)
    # and it stays: the engine itself, from there
    before = data.qpos.copy()
    for _ in range(20):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - before).max() < 1e-6


def test_the_actual_plant_with_another_mass_rests_by_its_own_control(tmp_path):
    heavier = Deviation(changes=(Change("mass", "rod", 1.1),))
    text = pendulum(MOTOR, key=f'qpos="{LEAN}"')
    assert found(tmp_path, text, STATIC, heavier).ctrl[0] == pytest.approx(1.1 * TORQUE)
    assert replace(STATIC, kind="as given") == OperatingRule()


def test_where_nothing_is_named_a_pose_at_rest_stands_and_another_is_balanced_with_a_word(tmp_path):
    """Upright as given; with its mass beside the axis the pole leans until it is above."""
    rule = OperatingRule("found")
    still = load_plant(written(tmp_path, pendulum(MOTOR)), operating=rule)
    assert still.told == ()
    assert still.linearisation.point.qpos[0] == 0
    beside = written(tmp_path, pendulum(MOTOR).replace('pos="0 0 0.9"', 'pos="0.05 0 0.9"'), "beside.xml")
    found = load_plant(beside, operating=rule)
    assert found.linearisation.point.qpos[0] == pytest.approx(-np.arctan(0.05 / 0.9), abs=1e-5)
    (notice,) = found.told
    assert notice.words.startswith("the pose is not at rest; balanced away from it by lean -0.055")
    idle = '<body name="arm" pos="0 0 1.5"><joint name="elbow" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/></body>'
    fixed = OperatingRule("found", pose={"lean": 0.0})
    swung = load_plant(written(tmp_path, pendulum(MOTOR, body=idle), "arm.xml"), operating=fixed)
    assert swung.quality.at_rest  # the arm hangs, or stands
    assert abs(np.sin(swung.linearisation.point.qpos[1])) == pytest.approx(1.0, abs=0.01)


def test_straight_knees_bend_where_balance_may_choose(tmp_path):
    """A leg whose knee stands at the end of its range: balance has a kink there, and one is found inside it."""
    leg = '<body name="leg" pos="0 0 1"><joint name="knee" axis="0 1 0" range="0 2" limited="true"/>'
    leg += '<inertial pos="0 0 0.3" mass="20" diaginertia="1 1 0.1"/></body>'
    motors = MOTOR + '<motor name="knee" joint="knee"/>'
    path = written(tmp_path, pendulum(motors, body=leg, key='qpos="0 0"'))
    plant = load_plant(path, operating=OperatingRule("balance"))
    assert all(plant.quality.merits)
    assert 0.02 < plant.linearisation.point.qpos[1] < 0.7
    held = load_plant(path, operating=OperatingRule("balance", pose={"knee": 0.0}))
    assert [kink.of for kink in held.quality.kinks] == ["knee"]
