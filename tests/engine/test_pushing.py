"""Pushes act on the body itself: momentum by the inverse mass matrix, whatever gain, gear and dynamics inputs have."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from engine_cases import controller, plant
from model_cases import MOTOR, MUSCLE, RICH, SERVO, pendulum, two, written
from scipy.integrate import solve_ivp

import icmj
from icmj.case.case import prepare, simulate_plant
from icmj.controller.controller import Controller
from icmj.controller.design import design_lq
from icmj.controller.hold import system_matched
from icmj.controller.trigger import Continuous
from icmj.cycle.jacobian import difference_jacobian, get_course, integrate_derivative
from icmj.cycle.return_map import ReturnMap
from icmj.engine.block import find_block
from icmj.engine.closed_loop import close_loop
from icmj.engine.deviation import Deviation
from icmj.engine.forces import compute_effects, compute_forces
from icmj.engine.isolation import isolate_engine
from icmj.engine.native.field import callbacks
from icmj.engine.plant import load_plant
from icmj.engine.push_table import make_table
from icmj.engine.reaction import centre_of_pressure
from icmj.engine.run import simulate
from icmj.errors import SimulationError
from icmj.linear.run import simulate as simulate_linear
from icmj.plant.linear_plant import Push
from icmj.runfile.reading import load_run
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Bias, Impulse, Noise, Step

HOW = [{"tolerance": 1e-9}, {"timestep": 2e-4}]
SHORT = 1e-6  # s: nothing moves meanwhile, so that an impulse is a change of momentum and nothing else
ON_TRUNK = {"body": "trunk", "force": (40.0, 0.0, -15.0), "torque": (0.0, 3.0, 0.0), "point": (0.02, 0.0, 0.4)}


def idle(body):
    """A controller that does nothing, for the plant."""
    linear = body.linearisation.plant
    design = design_lq(linear, R_c=1.0, R_o=1.0)
    none = replace(design, k=0 * design.k, L=0 * design.L)
    return Controller(none, system_matched(none), Continuous())


def kicked(body, source, **how):
    """Velocities right after an impulse on the body at its operating point, gravity's share taken off."""
    runs = [
        simulate(body, idle(body), Settings(duration=SHORT, disturbance=acting, **how), error_estimate=False)
        for acting in ((source,), ())
    ]
    nv = body.model.nv
    return runs[0].x[-1, nv : 2 * nv] - runs[1].x[-1, nv : 2 * nv]


def at_rest(body):
    """Mass matrix and data at the operating point, by MuJoCo's own functions and not by those under test."""
    model, point = body.model, body.linearisation.point
    data = mujoco.MjData(model)
    data.qpos[:] = point.qpos
    mujoco.mj_forward(model, data)
    M = np.array([np.zeros(model.nv)] * model.nv)
    for i, row in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, M[i], row)
    return M, model, data


@pytest.mark.parametrize("actuator", [MOTOR, SERVO, MUSCLE, '<motor name="ankle" joint="lean" gear="50"/>'])
@pytest.mark.parametrize("b", [1.0, 0.5])
def test_an_impulse_on_an_input_is_a_change_of_momentum_whatever_gain_and_gear(tmp_path, actuator, b):
    """1 N m s on a rod of J = 70 · 0.9² + 6 kg m²; by a muscle that pulls the other way it is the other way."""
    body = load_plant(written(tmp_path, pendulum(actuator)), Deviation(b))
    sign, J = -1.0 if actuator == MUSCLE else 1.0, 70 * 0.81 + 6
    jump = kicked(body, Impulse("ankle", 1.0, 0.0, SHORT))
    assert jump[0] == pytest.approx(sign / J, rel=1e-6)
    linear = body.linearisation.plant
    run = simulate_linear(
        linear, idle(body), Settings(duration=SHORT, disturbance=(Impulse("ankle", 1.0, 0.0, SHORT),))
    )
    assert run.x[-1, 1] == pytest.approx(sign / J, rel=1e-6)


@pytest.mark.parametrize("how", HOW, ids=str)
def test_an_impulse_on_a_body_is_momentum_by_the_jacobian_at_its_point(how):
    body = plant("three_link", 0.9)
    M, model, data = at_rest(body)
    trunk, J = model.body("trunk").id, np.zeros((2, 3, model.nv))
    there = data.xpos[trunk] + data.xmat[trunk].reshape(3, 3) @ ON_TRUNK["point"]
    mujoco.mj_jac(model, data, J[0], J[1], there, trunk)
    p = J[0].T @ ON_TRUNK["force"] + J[1].T @ ON_TRUNK["torque"]
    jump = kicked(
        body, Impulse(**ON_TRUNK, size=1e-3, duration=SHORT), **{**how, "timestep": how.get("timestep") and SHORT}
    )
    np.testing.assert_allclose(jump, 1e-3 * np.linalg.solve(M, p), rtol=1e-5)
    np.testing.assert_allclose(
        body.pushed([Push(**ON_TRUNK)]).effect(Push(**ON_TRUNK))[3:], np.linalg.solve(M, p), rtol=1e-8
    )


def test_the_centre_of_mass_is_where_a_force_acts_unless_told():
    body = plant("three_link")
    _, model, data = at_rest(body)
    trunk = model.body("trunk")
    one, other = Push(body="trunk", force=(1.0, 0, 0)), Push(body="trunk", force=(1.0, 0, 0), point=tuple(trunk.ipos))
    J = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, J, None, trunk.id)
    for push in (one, other):
        np.testing.assert_allclose(
            compute_forces(model, data, make_table(model, [push], (), ()), np.ones(1)), J[0], rtol=1e-12
        )


def test_what_an_input_moves_may_be_a_tendon_a_site_or_a_ball(tmp_path):
    """Virtual work: the force along an input is that which does the work of 1 N where its length grows by 1 m."""
    text = """<mujoco><worldbody>
      <body name="a"><joint name="lean" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 1" size="0.05"/>
        <site name="top" pos="0.1 0 0.8"/>
        <body pos="0 0 1"><joint name="ball" type="ball"/><geom size="0.1" pos="0 0 0.3"/></body></body>
      <site name="base" pos="0.5 0 0"/></worldbody>
      <tendon><spatial name="calf"><site site="base"/><site site="top"/></spatial></tendon>
      <actuator><motor name="t" tendon="calf" gear="-7"/><motor name="s" site="top" gear="0 0 3 0 4 0"/>
        <motor name="b" joint="ball" gear="0 2 0"/></actuator>
      <sensor><jointpos joint="lean"/></sensor></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[0] = 0.3
    mujoco.mj_forward(model, data)
    lengths, eps = [], 1e-6
    for sign in (1, -1):
        data.qpos[0] = 0.3 + sign * eps
        mujoco.mj_forward(model, data)
        lengths.append(data.ten_length[0])
    data.qpos[0] = 0.3
    mujoco.mj_forward(model, data)
    table = make_table(model, [Push(name) for name in "tsb"], ("t", "s", "b"), (0, 1, 2))
    along = [compute_forces(model, data, row[None], np.ones(1)) for row in table]
    # with a gear of −7 the actuator's length grows where the tendon shortens
    assert along[0][0] == pytest.approx(-(lengths[0] - lengths[1]) / (2 * eps), rel=1e-6)
    J = np.zeros((2, 3, model.nv))
    top = model.site("top").id
    mujoco.mj_jacSite(model, data, J[0], J[1], top)
    axes = data.site_xmat[top].reshape(3, 3)
    np.testing.assert_allclose(along[1], J[0].T @ axes @ [0, 0, 0.6] + J[1].T @ axes @ [0, 0.8, 0], atol=1e-12)
    np.testing.assert_allclose(along[2], [0, 0, 1, 0], atol=1e-12)


def test_a_push_and_noise_of_a_command_go_different_ways(tmp_path):
    """Through gain and gear beside the command; past both on the body. Noise is of the command unless told."""
    path = two(tmp_path)
    body = load_plant(path, Deviation([1.0, 0.5]))
    J = at_rest(body)[0]
    for source, size in (
        (Impulse("turn", 1.0, 0.0, SHORT), 1.0),
        (Impulse("turn", 1.0, 0.0, SHORT, on="command"), 0.5 * 20),
    ):
        np.testing.assert_allclose(kicked(body, source), np.linalg.solve(J, [0, size]), rtol=1e-6)
    settings = Settings(duration=0.2, record_interval=0.01)
    noise = {"size": 0.003, "bandwidth": 5.0, "seed": 1}
    loud = {
        on: simulate(body, idle(body), replace(settings, disturbance=(Noise("turn", **noise, **more),)))
        for on, more in (("default", {}), ("command", {"on": "command"}), ("body", {"on": "body"}))
    }
    np.testing.assert_array_equal(loud["default"].x, loud["command"].x)
    assert not loud["default"].pushes
    assert np.abs(loud["default"].applied - loud["default"].u)[:, 1].max() > 1e-3
    np.testing.assert_allclose(loud["command"].x[-1], 10 * loud["body"].x[-1], rtol=1e-3)
    np.testing.assert_allclose(
        loud["body"].push_values, (loud["default"].applied - loud["default"].u)[:, 1:], atol=1e-12
    )


SOURCES = (
    Impulse(**ON_TRUNK, size=2e-4, start=0.3003, duration=0.0717),
    Step("knee_torque", 0.01, 0.5),
    Noise(body="shank", force=(1.0, 0, 0), size=0.02, bandwidth=3.0, seed=2),
    Noise("ankle_torque", 0.01, corner=1.0, seed=1),
    Bias("trunk", 1e-4, 0.2),
)


def test_both_ways_of_stepping_agree_and_the_linear_plant_to_second_order_in_size():
    """Events, states and pushes of both engines' loops; the difference to the linear plant falls with the square."""
    body, errors = plant("three_link", 0.9), []
    for size in (1.0, 0.5):
        control = controller("three_link", 1e-3 * size)
        sources = tuple(replace(source, size=size * source.size) for source in SOURCES)
        settings = Settings(duration=1.5, record_interval=0.05, disturbance=sources)
        ways = ({"tolerance": 1e-11}, {"timestep": 1e-3})
        x0 = size * 1e-3 * np.eye(6)[0]
        runs = [simulate(body, control, replace(settings, **way), x0=x0, error_estimate=False) for way in ways]
        linear = simulate_linear(body.pushed(settings.pushes), control, settings, x0=x0)
        assert len(linear.events) >= 2
        assert len(runs[1].events) == len(runs[0].events)
        np.testing.assert_allclose(runs[1].events.t, runs[0].events.t, atol=1e-7)
        np.testing.assert_allclose(runs[1].x[-1], runs[0].x[-1], atol=1e-8 * size)
        at = np.isin(linear.t.round(9), runs[0].t.round(9)), np.isin(runs[0].t.round(9), linear.t.round(9))
        np.testing.assert_allclose(linear.push_values[at[0]], runs[0].push_values[at[1]], atol=1e-12)
        assert linear.push_names == ("trunk", "knee_torque", "shank")
        assert linear.push_units == ("", "N m", "N")
        errors.append(np.abs(runs[0].x[-1] - linear.x[-1]).max() / size)
    # the model is no mirror image of itself under a force at a point, so the first order is not odd
    assert errors[1] < 0.6 * errors[0]
    assert errors[0] < 1e-5


def test_a_constant_push_agrees_with_dop853_on_the_engine():
    """xfrc_applied at the moving point, by scipy on mj_forward; of the package but the controller's matrices."""
    body, control = plant("three_link", 0.9), replace(controller("three_link", 1e-2), trigger=Continuous())
    model, point = body.model, body.linearisation.point
    data, trunk, force = mujoco.MjData(model), body.model.body("trunk").id, np.array([3.0, 0.0, -1.0])
    settings = Settings(
        duration=0.6, disturbance=(Step(body="trunk", force=tuple(force), point=(0, 0, 0.5)),), tolerance=1e-11
    )
    run = simulate(body, control, settings, error_estimate=False)
    design = control.design

    def rate(t, z):
        q, v, x_o = np.split(z, [3, 6])
        data.qpos[:], data.qvel[:] = q, v
        data.ctrl[:] = point.ctrl - 0.9 * design.k @ x_o
        mujoco.mj_kinematics(model, data)
        arm = data.xmat[trunk].reshape(3, 3) @ [0, 0, 0.5] + data.xpos[trunk] - data.xipos[trunk]
        data.xfrc_applied[trunk] = np.concatenate([force, np.cross(arm, force)])
        mujoco.mj_forward(model, data)
        y = data.sensordata[: design.plant.n_y] - body.linearisation.y
        return np.concatenate([v, data.qacc, (design.A_o - design.plant.B @ design.k) @ x_o + design.L @ y])

    start = np.concatenate([point.qpos, point.qvel, np.zeros(6)])
    exact = solve_ivp(rate, (0, 0.6), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(run.x[-1], exact[:6] - np.concatenate([point.qpos, point.qvel]), atol=1e-8)


def test_the_return_map_under_a_constant_push_has_the_derivative_of_its_differences():
    """Steps of the loop, the course along them and the rates around it see the same force."""
    body, control = plant("three_link", 0.9), controller("three_link", 1e-3)
    step = Step(body="trunk", force=(0.05, 0, 0), point=(0, 0, 0.3))
    settings = Settings(duration=3.0, disturbance=(step, Step("hip_torque", 0.002)), tolerance=1e-11)
    run = simulate(body, control, settings, error_estimate=False)
    for actual in (body, body.pushed(settings.pushes)):
        loop = ReturnMap(actual, control, settings)
        z = loop.join(run.events.x[0], run.events.x_o[0], run.events.x_o[0])
        scale = np.full(loop.size, 1e-3)
        found = integrate_derivative(loop, get_course(loop, z, float(loop.turn(z).intervals[0])))
        expected = difference_jacobian(loop, z, scale).J
        # the spline through the course errs by 3e-6; a force that did not turn with the point would by 1e-4
        assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


def test_the_centre_of_pressure_knows_of_a_push(root):
    """A steady push of the trunk moves it; the load is the weight, less what lifts."""
    run = load_run(root / "runs" / "three-link-0.9.toml").with_(**{"assumed.model": "../models/three_link_floor.xml"})
    case = prepare(run)
    body, lift = case.model, 50.0
    settings = Settings(
        duration=0.02, timestep=1e-3, disturbance=(Step(body="trunk", force=(0.0, 0.0, lift), point=(0, 0, 0.3)),)
    )
    pushed = simulate_plant(body, case.controller, settings)
    weight = body.model.body_mass.sum() * 9.81
    ground = centre_of_pressure(body, pushed, case.controller)
    assert ground.load.sum(axis=1)[-1] == pytest.approx(weight - lift, rel=0.03)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (Step(body="head", force=(1, 0, 0)), r"push on body 'head': the model's bodies are .*trunk"),
        (Step(body="world", force=(1, 0, 0)), "push on body 'world'"),
        (Step("neck", 1.0), "push on input 'neck': the plant's inputs are ankle_torque"),
        (Step("neck", 1.0, on="command"), "disturbance on input 'neck': the plant's inputs are ankle_torque"),
    ],
)
def test_what_is_not_there_cannot_be_pushed(source, words):
    body, control = plant("three_link"), controller("three_link")
    with pytest.raises(SimulationError, match=words):
        simulate(body, control, Settings(duration=0.1, disturbance=(source,)))
    if source.body is not None:
        with pytest.raises(SimulationError, match=f"push on '{source.body}': a linear plant knows no bodies"):
            simulate_linear(body.linearisation.plant, control, Settings(disturbance=(source,)))


def test_effects_of_a_body_that_stands_go_through_its_contacts(root):
    """The ground answers: the column is that of differences over MuJoCo's own external force."""
    body = load_plant(root / "models" / "three_link_floor.xml", keyframe="upright")
    model, point = body.model, body.linearisation.point
    push = Push(body="trunk", force=(1.0, 0, 0))
    found = compute_effects(model, point, make_table(model, [push], (), ()))[model.nv :, 0]
    data, ends = mujoco.MjData(model), []
    model.opt.tolerance, model.opt.iterations = 0.0, 200
    for size in (0.02, -0.02):
        data.qpos[:], data.qvel[:], data.ctrl[:] = point.qpos, point.qvel, point.ctrl
        data.xfrc_applied[model.body("trunk").id, 0] = size
        mujoco.mj_forward(model, data)
        ends.append(data.qacc.copy())
    assert data.nefc
    expected = (ends[0] - ends[1]) / 0.04
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_the_loops_push_as_the_analysis_does(tmp_path):
    """A turned and moving frame, an input on a tendon, several at a place; and none where nothing is due."""
    calf = '<fixed name="calf"><joint joint="lean" coef="0.3"/><joint joint="turn" coef="-2"/></fixed>'
    pull = f'<tendon>{calf}</tendon><actuator><motor name="pull" tendon="calf" gear="-4"/>'
    text = RICH.replace("<actuator>", pull)
    body = load_plant(written(tmp_path, text.replace('ctrl="1 2"', 'ctrl="0 1 2"')), keyframe="up")
    on_c = {"body": "c", "force": (0.1, 0.2, -0.1), "torque": (0.01, 0, 0.02), "point": (0, 0.1, 0)}
    sources = (
        Step(**on_c, start=0.1),
        Noise(**on_c, size=0.4, bandwidth=2.0),
        Step(body="b", force=(1.0, 0, 0)),
        Impulse("low", 0.02, 0.2, 0.2),
        Step("pull", 0.7),
    )
    loop = close_loop(body, idle(body), Settings(duration=1.0, disturbance=sources))
    model, random = loop.model, np.random.default_rng(4)
    data, table = mujoco.MjData(model), find_block(model).pushes
    assert sorted(table[:, 0]) == [0, 1, 2, 2]
    with isolate_engine(*callbacks()):
        for t in (0.05, 0.15, 0.25, 0.5):
            data.time, data.qvel[:] = t, random.normal(size=model.nv)
            mujoco.mj_integratePos(model, data.qpos, random.normal(size=model.nv), 0.5)
            mujoco.mj_forward(model, data)
            expected = compute_forces(model, data, table, loop.pushes.size(np.array([t]))[0])
            np.testing.assert_allclose(data.qfrc_applied, expected, atol=1e-15)
            assert np.abs(expected).min() > 0 or t < 0.1


def test_an_acceleration_of_the_ground_is_a_force_on_each_body_in_proportion_to_its_mass():
    """Seen from the ground, it is another gravity, g − a; the linear plant takes the sum of the same pushes."""
    a, body, control = 0.05, plant("three_link"), controller("three_link").triggered_by(Continuous())
    bodies = {name: body.model.body(name).mass[0] for name in body.bodies}
    forced = tuple(Step(body=name, force=(-mass, 0.0, 0.0), size=a) for name, mass in bodies.items() if mass)
    settings = Settings(duration=1.0, tolerance=1e-11, record_interval=0.1)
    moved = simulate(body, control, replace(settings, disturbance=forced), error_estimate=False)
    tilted = icmj.Deviation(changes=(icmj.plant.Change("gravity", value=(-a, 0.0, -9.81)),))
    hanging = load_plant(body.path, tilted, "upright")
    other = simulate(hanging, control, settings, error_estimate=False)
    assert np.abs(moved.x[:, 0]).max() > 1e-3
    np.testing.assert_allclose(moved.x, other.x, atol=1e-9)
    linear = body.pushed(replace(settings, disturbance=forced).pushes)
    exact = simulate_linear(linear, control, replace(settings, disturbance=forced))
    assert np.abs(exact.x - moved.x).max() < 1e-3 * np.abs(exact.x).max()
