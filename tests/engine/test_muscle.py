"""Motors behind a lag on the engine: against linear augmentation, DOP853 with a muscle by hand; what is refused."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_cases import MODELS, controller, plant
from model_cases import BIASED, MOTOR, MUSCLE, RICH, SERVO, pendulum, written
from oracles.engine import flight
from tapped_cases import DAMPING, INERTIA, MGH, PERSON, STIFFNESS

import icmj
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.switching import SwitchingPD
from icmj.controller.trigger import Continuous
from icmj.engine.open_loop import open_loop
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.engine.run import simulate
from icmj.errors import ModelError
from icmj.plant import Activation, Selection
from icmj.simulation.settings import Settings
from icmj.theory.delay_roots import delay_loop, rightmost_roots

FIRST, SECOND = Activation(1, 0.05), Activation(2, frequency=16.8, damping_ratio=0.99)
SOME = Activation(2, {"knee_torque": 0.04, "ankle_torque": 0.07}, damping_ratio={"ankle_torque": 0.8})


def muscled(activation: Activation, model: str = "three_link", gain: float = 1.0) -> MujocoPlant:
    return load_plant(MODELS / f"{model}.xml", icmj.Deviation(gain=gain), "upright", activation=activation)


def chain(seed: int, folder: Path) -> Path:
    """A chain of random bodies on hinges and slides, which stands or leans, with motors of random gear."""
    rng = np.random.default_rng(seed)
    bodies, motors, sensors, ctrl, qpos = "", "", "", [], []
    count = int(rng.integers(1, 4))
    for i in range(count):
        kind = "slide" if rng.random() < 0.2 else "hinge"
        bodies += (
            f'<body name="b{i}" pos="0 0 {0.4 * (i > 0)}"><joint name="j{i}" type="{kind}" axis="0 1 0" '
            f'damping="{rng.uniform(0, 3):.3f}" stiffness="{rng.uniform(0, 30):.3f}"/>'
            f'<inertial pos="{rng.normal(scale=0.05):.3f} 0 {rng.uniform(0.1, 0.4):.3f}" '
            f'mass="{rng.uniform(1, 9):.3f}" diaginertia="0.1 0.1 0.1"/>'
        )
        motors += f'<motor name="m{i}" joint="j{i}" gear="{rng.uniform(0.5, 20):.3f}"/>'
        sensors += f'<jointpos name="y{i}" joint="j{i}"/>'
        ctrl.append(rng.normal())
        qpos.append(rng.normal(scale=0.1))
    text = f"""<mujoco><option integrator="RK4"><flag contact="disable"/></option><worldbody>{bodies}{"</body>" * count}
      </worldbody><actuator>{motors}</actuator><sensor>{sensors}</sensor>
      <keyframe><key name="there" qpos="{" ".join(map(str, qpos))}" ctrl="{" ".join(map(str, ctrl))}"/></keyframe>
      </mujoco>"""
    return written(folder, text, f"chain{seed}.xml")


@pytest.mark.parametrize("activation", [FIRST, SECOND, SOME])
def test_its_linearisation_is_the_bodys_behind_the_lag(activation):
    there, bare = muscled(activation, gain=0.9).linearisation.plant, plant("three_link").linearisation.plant
    expected = activation.before(bare).scaled(0.9)
    assert (there.states, there.state_units) == (expected.states, expected.state_units)
    for name in ("A", "B", "C", "B_d"):
        assert getattr(there, name) == pytest.approx(getattr(expected, name), rel=1e-8, abs=1e-7), name


@pytest.mark.parametrize("seed", range(6))
def test_so_is_that_of_any_chain_which_its_motors_hold(seed, tmp_path):
    rng, path = np.random.default_rng(seed), chain(seed, tmp_path)
    rule = icmj.plant.OperatingRule("static control")
    activation = (Activation(1, rng.uniform(0.02, 0.2)), Activation(2, rng.uniform(0.02, 0.2)))[seed % 2]
    bare, behind = (load_plant(path, keyframe="there", operating=rule, activation=a) for a in (None, activation))
    expected, there = activation.before(bare.linearisation.plant), behind.linearisation.plant
    assert there.states == expected.states
    for name in ("A", "B", "C", "B_d"):
        a, b = getattr(there, name), getattr(expected, name)
        assert np.abs(a - b).max() < 1e-6 * max(1.0, np.abs(b).max()), name
    # and it is at rest there, activations at what the motors give
    assert behind.quality.at_rest
    held, size = behind.linearisation.point, activation.order
    assert held.act[size - 1 :: size] == pytest.approx(bare.linearisation.point.ctrl, abs=1e-7)


@pytest.mark.parametrize(("activation", "lag"), [(FIRST, (0.05,)), (SECOND, (16.8, 0.99))])
@pytest.mark.parametrize("model", ["pendulum", "three_link"])
def test_an_interval_is_that_of_the_bare_body_with_a_muscle_by_hand(activation, lag, model):
    body, control = muscled(activation, model, 0.9), controller(model, 0.02)
    n, nv = body.linearisation.plant.n, body.model.nv
    x = np.zeros(n)
    x[:nv], x[2 * nv :] = 0.02, 0.3
    x_o = np.zeros(2 * nv)
    true = flight(plant(model, 0.9), control, x, x_o, [lag] * nv)
    found = open_loop(body, control, Settings(duration=5.0, tolerance=1e-11))(x, x_o)
    assert found.length == pytest.approx(true.length, rel=1e-10)
    assert found.y_max == pytest.approx(true.y_max, abs=1e-10)
    if model == "three_link":  # of the pendulum's interval the largest part of the error cancels
        by_step = (Settings(duration=5.0, timestep=h, integrator="RK4") for h in (4e-3, 2e-3))
        errors = [open_loop(body, control, settings)(x, x_o).length - true.length for settings in by_step]
        assert errors[0] / errors[1] == pytest.approx(16, rel=0.05)


@pytest.mark.parametrize("activation", [FIRST, SOME])
def test_it_is_the_linear_plant_to_second_order_in_the_sway(activation):
    """Relative: the body is odd in its angles."""
    body = muscled(activation)
    exact = body.linearisation.plant
    gains = design_lq(exact, R_c=5e-7, R_o=2e-7)
    control = icmj.Controller(gains, system_matched(gains), EventTrigger(output_weight(gains), 1e-3))
    apart = []
    for size in (0.04, 0.02, 0.01):
        settings = Settings(duration=1.0, tolerance=1e-11, record_interval=0.25)
        loose = control.triggered_by(Continuous())
        x0 = np.zeros(exact.n)
        x0[0] = size
        run = simulate(body, loose, settings, x0=x0, error_estimate=False)
        linear = icmj.simulate_plant(exact, loose, settings, x0=x0)
        apart.append(np.abs(run.x - linear.x).max(axis=0) / size)
    slopes = np.log2(np.divide(apart[:-1], apart[1:]))
    assert slopes == pytest.approx(np.full(slopes.shape, 2.0), abs=0.1)


def test_a_delayed_loop_has_the_roots_of_its_characteristic_equation(tmp_path):
    """(Is² + Bs + K − mgh)(s² + 2ζω₀s + ω₀²) + ω₀²(P + Ds) e^{−sτ} = 0, and the motion turns and sinks by them."""
    body = load_plant(written(tmp_path, PERSON), activation=SECOND)
    law = SwitchingPD(body.linearisation.plant, "theta", "omega", P=0.5 * MGH, D=180.0, delay=0.1, switches=False)
    roots = rightmost_roots(delay_loop(body.linearisation.plant, law), 4)
    for s in roots:
        parts = (INERTIA * s * s + DAMPING * s + STIFFNESS - MGH) * (s * s + 2 * 0.99 * 16.8 * s + 16.8**2)
        assert abs(parts + 16.8**2 * (0.5 * MGH + 180 * s) * np.exp(-0.1 * s)) < 1e-6 * abs(parts)
    settings = Settings(duration=6.0, tolerance=1e-11, record_interval=0.1)
    run = simulate(body, law, settings, x0=[1e-5, 0, 0, 0], error_estimate=False)
    linear = icmj.simulate_plant(body.linearisation.plant, law, settings, x0=[1e-5, 0, 0, 0])
    assert np.abs(run.x - linear.x).max(axis=0) == pytest.approx(0, abs=1e-8)
    # what remains after a while is of these roots alone: a fixed recurrence from row to row
    late = linear.y[20:, 0]
    left = np.convolve(late, np.poly(np.exp(0.1 * roots)).real, "valid")
    assert np.abs(left).max() < 1e-9 * np.abs(late).max()


def test_motors_and_actuators_with_states_of_their_own_stand_side_by_side(tmp_path):
    """Keyframes keep the activations that the model gives, and muscles rest at their control."""
    own = '<general name="slow" joint="lean" dyntype="filter" dynprm="0.3"/>'
    text = pendulum(own + MOTOR, key='qpos="0" act="7" ctrl="7 -7"')
    given = load_plant(written(tmp_path, text), keyframe="stand")
    for activation, states in (
        (Activation(1, {"ankle": 0.1}), ("slow_act", "ankle_act")),
        (Activation(2, {"ankle": 0.1}), ("slow_act", "ankle_act0", "ankle_act1")),
    ):
        body = load_plant(given.path, keyframe="stand", activation=activation)
        assert body.linearisation.plant.states[2:] == states
        assert body.linearisation.point.act.tolist() == [7, *[0] * (activation.order - 1), -7]
        assert body.quality.at_rest
        assert body.rest.act.tolist() == [7]
        again = load_plant(given.path, start=body.rest, activation=activation)
        assert again.linearisation.point.act.tolist() == body.linearisation.point.act.tolist()
        assert mujoco.MjSpec.from_string(body.xml).compile().na == body.model.na
        chosen = load_plant(given.path, keyframe="stand", selection=Selection(inputs=("ankle",)), activation=FIRST)
        assert chosen.linearisation.plant.states[2:] == ("slow_act", "ankle_act")
    with pytest.raises(ModelError, match=r"model.xml: activation: input 'slow' has dynamics of its own"):
        load_plant(given.path, keyframe="stand", activation=FIRST)


@pytest.mark.parametrize(("actuator", "words"), [(SERVO, "is no motor"), (BIASED, "is no motor"), (MUSCLE, "dynamics")])
def test_what_is_no_motor_is_refused(actuator, words, tmp_path):
    with pytest.raises(ModelError, match=f"input 'ankle' .*{words}") as caught:
        load_plant(written(tmp_path, pendulum(actuator)), keyframe="stand", activation=FIRST)
    assert "\n" not in str(caught.value)


def test_quaternions_and_motors_that_no_model_names_have_muscles_too(tmp_path):
    text = RICH.replace('name="low" ', "").replace("angle=", "")
    body = load_plant(written(tmp_path, text), keyframe="up", activation=Activation(1, {"u0": 0.1}))
    assert body.linearisation.plant.states[-1] == "u0_act"
    assert body.linearisation.point.act.tolist() == [1]


def test_a_wrong_time_constant_is_a_change_like_others():
    changed = icmj.Deviation(changes=(icmj.plant.Change("dynprm", "knee_torque", factor=1.5),), rho=0.5)
    body = load_plant(MODELS / "three_link.xml", changed, "upright", activation=FIRST)
    assert np.diag(body.linearisation.plant.A)[6:] == pytest.approx([-20, -20 / 1.25, -20])
