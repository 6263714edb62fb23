"""A support surface that moves: against a model whose base is moved, closed forms, and the linear plant."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import icmj
from icmj import IcmjError, LinearPlant, load_run, parse_run, prepare, simulate
from icmj.controller.setpoint import ternary
from icmj.engine.moving_ground import push_bodies
from icmj.plant.linear_plant import Push
from icmj.simulation.ternary import make_ternary_lines

LEGS = """
<body name="leg" pos="0 0 0.08"><joint name="ankle" axis="0 1 0" stiffness="900" damping="30"/>
  <inertial pos="0.01 0 0.5" mass="30" diaginertia="1.7 1.5 0.4"/>
  <body name="trunk" pos="0 0 0.9"><joint name="hip" axis="0 1 0" stiffness="700" damping="40"/>
    <inertial pos="0.02 0 0.35" mass="45" diaginertia="2.8 2.5 0.6"/></body></body>"""
STILL = f"""<mujoco><option integrator="RK4"/><worldbody>{LEGS}</worldbody>
<actuator><motor name="at_ankle" joint="ankle"/><motor name="at_hip" joint="hip"/></actuator></mujoco>"""
MOVED = f"""<mujoco><worldbody><body name="base">
<joint name="x" type="slide" axis="1 0 0"/><joint name="phi" axis="0 1 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{LEGS}</body></worldbody></mujoco>"""
INTEGRATOR = LinearPlant(np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), outputs=("y0",))
RUN = """
case = { name = "moved", title = "On a surface that moves" }
assumed = { model = "still.xml", outputs = "joints" }
design = { R_c = 1e-3 }
controller = { q_t = 1e9 }
simulation = { duration = 4.0, record_interval = 0.02, limit = 3.0 }
"""
LINES = {"frequencies": [0.3, 0.9], "phases": [0.4, 2.0]}


def case_of(folder, size, surface):
    (folder / "still.xml").write_text(STILL)
    moves = {"kind": "sines", "surface": surface, "size": [size, size / 3], **LINES}
    if surface == "tilt":
        moves["point"] = [0.1, 0.0, -0.2]
    run = parse_run(RUN, folder / "moved.toml").with_(**{"simulation.disturbance": [moves]})
    return icmj.prepare(run)


def on_a_moved_base(size, surface, times, passive):
    """The same body on a base whose joint follows the course: M θ̈ = τ − c − M₍θ,base₎ of what the base does."""
    model = mujoco.MjModel.from_xml_string(MOVED)
    if surface == "tilt":  # about an axis through another point: the base's hinge is there
        model.jnt_pos[1] = [0.1, 0.0, -0.2]
    data, base, M = mujoco.MjData(model), 0 if surface == "translation" else 1, np.zeros((4, 4))
    omega, phase, a = 2 * np.pi * np.array(LINES["frequencies"]), np.array(LINES["phases"]), np.array([1, 1 / 3]) * size

    def course(t):
        angle = omega * t + phase
        if surface == "translation":  # the sum is an acceleration
            return (-a / omega**2) @ np.cos(angle), (a / omega) @ np.sin(angle), a @ np.cos(angle)
        return a @ np.cos(angle), -(a * omega) @ np.sin(angle), -(a * omega**2) @ np.cos(angle)

    def rates(t, state):
        data.qpos[:], data.qvel[:] = 0, 0
        data.qpos[base], data.qvel[base], acceleration = course(t)
        data.qpos[2:], data.qvel[2:] = state[:2] + passive.rest, state[2:]
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, M)
        force = data.qfrc_passive[2:] - data.qfrc_bias[2:] + passive.held - M[2:, base] * acceleration
        return np.concatenate([state[2:], np.linalg.solve(M[2:, 2:], force)])

    return solve_ivp(rates, (0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-11, atol=1e-13).y.T


class Passive:
    """What holds the body at its operating point, where nothing moves."""

    def __init__(self, plant):
        self.rest = plant.linearisation.point.qpos
        model = mujoco.MjModel.from_xml_string(STILL)
        data = mujoco.MjData(model)
        data.qpos[:] = self.rest
        mujoco.mj_forward(model, data)
        self.held = data.qfrc_bias - data.qfrc_passive


@pytest.mark.parametrize("surface", ["translation", "tilt"])
def test_it_is_the_motion_on_a_base_that_moves(surface, tmp_path):
    """Nothing but joints holds the body. What is left out of a tilt is of second order; of a translation nothing is."""
    sizes, left, apart = np.array([0.02, 0.01, 0.005]), [], []
    for size in sizes:
        case = case_of(tmp_path, size, surface)
        run, linear = (icmj.simulate(case, plant) for plant in ("mujoco", "linear"))
        assert len(run.events) == 0
        moved = on_a_moved_base(size, surface, run.t, Passive(case.actual))
        reach = np.abs(moved[:, :2]).max()
        assert reach > 1e-4
        left.append(np.abs(run.x[:, :2] - moved[:, :2]).max() / reach)
        apart.append(
            np.abs(run.x[:, :2] - np.array([np.interp(run.t, linear.t, x) for x in linear.x[:, :2].T]).T).max()
        )
    if surface == "translation":
        assert max(left) < 1e-7
    else:
        assert left[-1] < 2e-3
        assert 0.8 < np.polyfit(np.log(sizes), np.log(left), 1)[0] < 1.3
    assert np.polyfit(np.log(sizes), np.log(apart), 1)[0] > 1.8


@pytest.mark.parametrize("vertical_share", [0.0, 0.3, 1.0])
def test_the_delayed_loop_answers_a_tilt_as_its_transfer_function_does(vertical_share):
    """Body over surface of independent channels: (P B + W N D) / (1 + P B + N B D), B the body, D the delay."""
    lines, period, duration = np.array([0.1, 0.3, 0.7]), 10.0, 60.0
    vertical = {"lean": vertical_share}  # the rate is sensed by the joint alone
    tilt = {"kind": "sines", "surface": "tilt", "size": 0.002, "frequencies": lines.tolist(), "vertical": vertical}
    tilt |= {"phases": [0.3, 1.0, -2.0], "point": [0.0, 0.0, 0.06]}
    changes = {"simulation.disturbance": [tilt], "simulation.duration": duration, "simulation.initial": {}}
    run = simulate(prepare(load_run("one-link-delayed-pd").with_(**changes)), "linear")
    t = np.arange(0, period, 0.01)
    lean = np.interp(duration - period + t, run.t, run.x[:, 0])
    s = 2j * np.pi * lines
    alpha = 0.002 * np.exp(1j * np.array([0.3, 1.0, -2.0]))
    theta = np.array([2 * np.mean(lean * np.exp(-2j * np.pi * f * t)) for f in lines])  # whole periods before the end
    J, mgh, K, B, P, D = 60.0, 588.6, 470.88, 4.0, 470.88, 270.0
    body, passive, late = 1 / (J * s**2 - mgh), K + B * s, np.exp(-0.2 * s)
    sensed = P * (1 - vertical_share) + D * s
    expected = (passive * body + sensed * body * late) / (1 + passive * body + (P + D * s) * body * late)
    np.testing.assert_allclose((theta + alpha) / alpha, expected, rtol=1e-6)


def test_a_model_of_one_body_has_a_surface_in_mujoco_too():
    tilt = {"kind": "sines", "surface": "tilt", "size": 0.001, "frequencies": [0.3, 0.7], "point": [0, 0, 0.06]}
    changes = {"simulation.disturbance": [tilt], "simulation.duration": 5.0, "simulation.initial": {}}
    trial = prepare(load_run("one-link-delayed-pd").with_(**changes))
    linear, engine = (simulate(trial, plant) for plant in ("linear", "mujoco"))
    assert np.abs(linear.x[:, 0]).max() > 1e-4
    np.testing.assert_allclose(engine.x[-1], linear.x[-1], atol=1e-7)


def test_compensated_gravity_does_not_turn(tmp_path):
    (tmp_path / "still.xml").write_text(STILL.replace('<body name="trunk"', '<body name="trunk" gravcomp="1"'))
    plant = icmj.load_plant(tmp_path / "still.xml", selection=icmj.plant.Selection(outputs="joints"))
    parts = push_bodies(plant.model, plant.linearisation.point, Push(surface="gravity", axis=(0, 1, 0)))
    assert [part.body for part in parts] == ["leg"]
    np.testing.assert_allclose(parts[0].force, [30 * 9.81, 0, 0], atol=1e-12)


def test_a_translation_is_the_weight_of_all_that_moves(root):
    plant = icmj.load_plant(root / "models" / "three_link.xml", keyframe="upright")
    parts = push_bodies(plant.model, plant.linearisation.point, Push(surface="translation", axis=(2, 0, 0)))
    moving = plant.model.body_mass[plant.model.body_weldid > 0].sum()
    np.testing.assert_allclose(np.sum([part.force for part in parts], axis=0), [-moving, 0, 0], rtol=1e-12, atol=1e-12)


def test_a_sequence_of_full_length_is_the_sum_of_its_lines():
    whole = icmj.setpoint(INTEGRATOR, [icmj.Target({"y0": 1.0}, ternary(0.03, 0.25, 0.0, 60.5))])
    t = np.linspace(0, 60.5, 3001)[:-1]
    for highest, closeness in ((2.0, 0.02), (40.0, 1e-3)):
        a, omega, phi = make_ternary_lines(0.03, 0.25, highest).T
        drawn = np.cos(np.outer(t, omega) + phi) @ a
        path = whole(t)[:, 0]
        assert np.abs(drawn - (path - path.mean())).max() < closeness * 0.03
    assert np.ptp(path) == pytest.approx(0.03, rel=1e-12)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "step", "surface": "tilt", "size": 0.01}, "a tilt of kind 'step' has no finite acceleration"),
        ({"kind": "noise", "surface": "tilt", "size": 0.01, "corner": 1.0, "seed": 1, "start": 1.0}, "begins or ends"),
        ({"kind": "step", "surface": "translation", "size": 0.1, "input": "ankle_torque"}, "give one of"),
        ({"kind": "step", "size": 0.1, "input": "ankle_torque", "axis": [1, 0, 0]}, "axis belongs to a motion"),
        ({"kind": "step", "surface": "translation", "size": 0.1, "vertical": {"lean": 1.0}}, "apply only to a tilt"),
        ({"kind": "step", "surface": "translation", "size": 0.1, "axis": [0, 0, 0]}, "no direction"),
        ({"kind": "sines", "surface": "tilt", "size": [1, 2, 3], "frequencies": [0.1, 0.2]}, "one size or as many"),
        ({"kind": "ternary", "surface": "tilt", "size": 0.1, "bandwidth": 0.001}, "no line up to"),
        ({"kind": "ternary", "surface": "tilt", "size": 0.0}, "nothing is left of a size of 0"),
        ({"kind": "ternary", "input": "ankle_torque", "size": 1.0, "interval": 1e9, "bandwidth": 2.0}, "at most 20000"),
    ],
)
def test_what_cannot_be_is_one_line(table, words):
    with pytest.raises(IcmjError, match=words) as told:
        prepare(load_run("one-link-delayed-pd").with_(**{"simulation.disturbance": [table]}))
    assert "\n" not in str(told.value)


def test_a_plant_without_bodies_has_no_surface():
    with pytest.raises(IcmjError, match="on 'surface translation': a linear plant knows no bodies"):
        INTEGRATOR.effect(Push(surface="translation", axis=(1, 0, 0)))
