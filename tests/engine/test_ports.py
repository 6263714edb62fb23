"""The plant's ports: the input gain is one, names choose and match, units are the model's."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from model_cases import BIASED, MOTOR, MUSCLE, SERVO, pendulum, two, written

from icmj.cli.main import main
from icmj.controller.controller import Controller
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.engine.deviation import Deviation
from icmj.engine.plant import load_plant
from icmj.engine.run import simulate
from icmj.errors import ModelError
from icmj.plant.body import Change, Selection
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Impulse
from icmj.theory.error_system import error_system
from icmj.theory.prediction import predict

LEAN = np.radians(3.0)
HOLDING = 70 * 9.81 * 0.9 * np.sin(LEAN)


def controlled(assumed, q_t=1e-3):
    """A controller for a plant of these tests; the weights suit a torque."""
    plant = assumed.linearisation.plant
    size = float(np.abs(plant.B).max())  # rad/s² for each unit of the input
    design = design_lq(plant, R_c=1e-3 * size**2, R_o=0.01 * size**2)
    return Controller(design, system_matched(design), EventTrigger(output_weight(design), q_t, 1e-3))


@pytest.mark.parametrize("actuator", [MOTOR, SERVO, BIASED])
def test_gain_scales_the_effect_of_an_input_and_nothing_else(tmp_path, actuator):
    path = written(tmp_path, pendulum(actuator))
    plain, weak = load_plant(path).linearisation, load_plant(path, Deviation(0.9)).linearisation
    np.testing.assert_array_equal(weak.plant.A, plain.plant.A)
    np.testing.assert_array_equal(weak.plant.B, 0.9 * plain.plant.B)
    np.testing.assert_array_equal(weak.point.ctrl, plain.point.ctrl)
    assert weak.residual == plain.residual


def test_a_muscle_of_less_gain_has_less_torque_for_each_unit_of_excitation(tmp_path):
    path = written(tmp_path, pendulum(MUSCLE, key='qpos="0" ctrl="0.3" act="0.3"'))
    plain, weak = (load_plant(path, Deviation(b), "stand").linearisation.plant for b in (1.0, 0.9))
    np.testing.assert_allclose(weak.B, 0.9 * plain.B, rtol=1e-12)
    np.testing.assert_array_equal(weak.A, plain.A)  # torque for activation and its dynamics are the muscle's own


@pytest.mark.parametrize("actuator", [MOTOR, SERVO, BIASED])
def test_a_lean_with_its_static_control_stays_in_balance_and_settles_as_predicted(tmp_path, actuator):
    """The gain must leave the static torque alone; a gear would not, and the body would tip over."""
    # a torque forwards is positive, gravity's is, too: what holds is negative
    holding = {MOTOR: -HOLDING, SERVO: LEAN - HOLDING / 400, BIASED: (-HOLDING - 5 + 30 * LEAN) / 2}[actuator]
    path = written(tmp_path, pendulum(actuator, key=f'qpos="{LEAN:.17g}" ctrl="{holding:.17g}"'))
    assumed, actual = (load_plant(path, Deviation(b), "stand") for b in (1.0, 0.9))
    assert actual.linearisation.residual < 1e-12
    control = controlled(assumed, 2e-4)
    linear = predict(error_system(actual.linearisation.plant, control.design), control.trigger)
    assert linear.verdict == "attracting"
    run = simulate(actual, control, Settings(duration=12.0), x0=[4e-4, 0.0])
    # a lean has no odd symmetry: the departure from the linear interval is of the first order in the threshold
    assert run.events.interval[-1] == pytest.approx(linear.delta_crit, rel=2e-4)


def test_the_disturbance_passes_the_gain_and_the_observer_does_not(tmp_path):
    """Beside the command, d acts as b d beside b u; with no feedback it alone moves the body."""
    path = written(tmp_path, pendulum(MOTOR))
    assumed = load_plant(path)
    control = controlled(assumed)
    idle = replace(control, design=replace(control.design, k=0 * control.design.k, L=0 * control.design.L))
    settings = Settings(duration=0.2, disturbance=(Impulse("ankle", 1.0, 0.0, 0.1, on="command"),))
    ends = [simulate(load_plant(path, Deviation(b)), idle, settings).x[-1] for b in (1.0, 0.5)]
    np.testing.assert_allclose(ends[1], 0.5 * ends[0], rtol=1e-6)


def test_a_list_of_gains_follows_the_inputs_as_they_are_chosen(tmp_path):
    path = two(tmp_path)  # push, turn

    def effect(inputs, gain):
        return load_plant(path, Deviation(gain), selection=Selection(inputs)).linearisation.plant.B

    plain, here = effect(("push", "turn"), 1.0), effect(("push", "turn"), [0.5, 0.9])
    np.testing.assert_array_equal(here, plain * [0.5, 0.9])
    np.testing.assert_array_equal(effect(None, [0.5, 0.9]), here)
    np.testing.assert_array_equal(effect(("turn", "push"), [0.5, 0.9]), plain[:, ::-1] * [0.5, 0.9])
    np.testing.assert_array_equal(effect(("turn",), [0.5]), plain[:, 1:] * 0.5)
    with pytest.raises(ModelError, match="gain has 2 entries for 1 inputs, turn"):
        effect(("turn",), [0.5, 0.9])
    named = Deviation(changes=(Change("input_gain", "turn", 0.5),))
    turned = load_plant(path, named, selection=Selection(("turn", "push"))).linearisation.plant.B
    np.testing.assert_array_equal(turned, plain[:, ::-1] * [0.5, 1.0])


def test_a_change_of_a_sensor_is_of_all_its_entries(tmp_path):
    """A list gives one number for each of them; without a name every entry of every sensor is meant."""
    sensor = '<framepos name="top.of" objtype="site" objname="top"/>'
    path = written(tmp_path, pendulum(MOTOR, sensor=sensor))

    def errors(change):
        ports = load_plant(path, Deviation(changes=(change,))).linearisation.ports
        return ports.g.tolist(), ports.beta.tolist()

    assert errors(Change("sensor_bias", "top.of", value=[0.1, 0.2, 0.3]))[1] == [0, 0.1, 0.2, 0.3]
    assert errors(Change("sensor_bias", "top.of", value=0.1))[1] == [0, 0.1, 0.1, 0.1]
    assert errors(Change("sensor_bias", "top.of.1", value=0.1))[1] == [0, 0, 0.1, 0]
    assert errors(Change("sensor_gain", factor=1.1))[0] == [1.1] * 4


def test_units_are_the_models(tmp_path):
    plant = load_plant(two(tmp_path)).linearisation.plant
    assert plant.state_units == ("m", "rad", "m/s", "rad/s")
    assert plant.input_units == ("N", "20 N m")
    assert plant.output_units == ("m", "rad")
    servo = load_plant(written(tmp_path, pendulum(SERVO))).linearisation.plant
    assert (servo.input_units, servo.output_units) == (("rad",), ("rad",))


def test_inputs_and_outputs_are_found_by_name_in_any_order(tmp_path):
    here, there = (load_plant(two(tmp_path, order, f"{order}.xml")) for order in (1, -1))
    names = Selection(("push", "turn"), ("place", "angle"))
    again = load_plant(there.path, selection=names).linearisation.plant
    assert (again.inputs, again.outputs) == (("push", "turn"), ("place", "angle"))
    for matrix in "ABC":
        np.testing.assert_array_equal(getattr(again, matrix), getattr(here.linearisation.plant, matrix))
    # and the closed loop is the same motion
    control = controlled(here)
    runs = [
        simulate(plant, control, Settings(duration=1.0), x0=[0.01, 0.02, 0, 0])
        for plant in (here, load_plant(there.path, selection=names))
    ]
    for what in ("x", "y", "u"):
        np.testing.assert_allclose(getattr(runs[1], what), getattr(runs[0], what), atol=1e-12)
    np.testing.assert_allclose(runs[1].events.y_max, runs[0].events.y_max, atol=1e-12)


def test_what_is_not_chosen_stays_out(tmp_path):
    """One input and one output of two: the other actuator rests, the other sensor is not read."""
    path = two(tmp_path)
    part = load_plant(path, selection=Selection(("turn",), ("angle",), drop=("x",)))
    plant, whole = part.linearisation.plant, load_plant(path).linearisation.plant
    assert plant.states == ("tilt", "x_rate", "tilt_rate")
    np.testing.assert_array_equal(plant.A, whole.A[1:, 1:])
    np.testing.assert_array_equal(plant.B, whole.B[1:, 1:])
    control = controlled(part)
    run = simulate(part, control, Settings(duration=1.0), x0=[0.02, 0, 0])
    assert run.x.shape[1] == 3
    assert run.x[0] == pytest.approx([0.02, 0, 0])
    assert run.qpos[-1, 0] != 0  # the cart moves, unobserved


def test_joints_are_outputs_where_there_is_no_sensor(tmp_path):
    path = two(tmp_path, sensors=False)
    plant = load_plant(path, selection=Selection(outputs="joints")).linearisation.plant
    assert (plant.outputs, plant.output_units) == (("x", "tilt"), ("m", "rad"))
    np.testing.assert_allclose(plant.C, np.eye(2, 4), atol=1e-10)
    rates = load_plant(path, selection=Selection(outputs=("tilt", "x_rate"))).linearisation.plant
    np.testing.assert_allclose(rates.C, np.eye(4)[[1, 2]], atol=1e-10)


def test_a_free_and_a_ball_joint_are_outputs_too(tmp_path):
    text = """<mujoco><worldbody><body pos="0 0 1"><freejoint name="root"/><geom size="0.1" mass="1"/>
      <body pos="0 0 0.2"><joint type="ball" name="neck"/><geom size="0.1" pos="0 0 0.2" mass="1"/></body></body>
      </worldbody><actuator><motor joint="neck" gear="1 0 0" name="nod"/></actuator></mujoco>"""
    plant = load_plant(written(tmp_path, text), selection=Selection(outputs="joints")).linearisation.plant
    assert plant.outputs[:3] == ("root.0", "root.1", "root.2")
    assert plant.n_y == 3 + 4 + 4
    assert np.linalg.matrix_rank(plant.C[:, :9]) == 9  # all nine positions are seen


@pytest.mark.parametrize(
    ("selection", "words"),
    [
        (Selection(inputs=("pull",)), "no input 'pull'; it has push, turn"),
        (Selection(outputs=("angel",)), "no output 'angel'; it has place, angle"),
        (Selection(states=("y",)), "no state 'y'; it has x, tilt, x_rate, tilt_rate"),
        (Selection(outputs=("angle", "angle")), "chosen twice"),
        (Selection(drop=("x", "tilt", "x_rate", "tilt_rate")), "no state is left"),
    ],
)
def test_names_that_are_not_there_are_refused_with_those_that_are(tmp_path, selection, words):
    with pytest.raises(ModelError, match=words):
        load_plant(two(tmp_path), selection=selection)


def test_sensors_err_as_told(tmp_path):
    """A gain of the sensor is one of C; a bias shows in the run, where the body settles leaning against it."""
    path = written(tmp_path, pendulum(MOTOR))
    plain = load_plant(path)
    gained = load_plant(path, Deviation(changes=(Change("sensor_gain", "angle", 1.1),)))
    np.testing.assert_allclose(gained.linearisation.plant.C, 1.1 * plain.linearisation.plant.C)
    control = controlled(plain)
    run = simulate(gained, control, Settings(duration=0.5), x0=[0.01, 0])
    np.testing.assert_allclose(run.y[:, 0], 1.1 * run.x[:, 0], rtol=1e-12)
    biased = load_plant(path, Deviation(changes=(Change("sensor_bias", "angle", value=0.002),)))
    run = simulate(biased, control, Settings(duration=0.5), x0=[0.01, 0])
    np.testing.assert_allclose(run.y[:, 0], run.x[:, 0] + 0.002, rtol=1e-12)
    assert mujoco.get_mjcb_control() is None


SEVERAL = {
    "pid": ('<pid name="m" joint="lean" kp="900" kv="100" ki="50"/>', "'m' has 2 inputs and 1 outputs"),
    "no input": ('<dcmotor name="m" joint="lean" motorconst="1" resistance="1" input="none"/>', "'m' has 0 inputs"),
    "orientation": (
        '<orientation joint="ball" kp="20"/>',
        "'u0' has 3 inputs and 3 outputs; icmj takes actuators with one of each",
    ),
}


@pytest.mark.parametrize("name", SEVERAL)
def test_an_actuator_of_several_controls_is_refused_in_one_line(tmp_path, name, capsys):
    actuator, words = SEVERAL[name]
    ball = (
        '<body pos="0 0 1"><joint name="ball" type="ball"/><geom size="0.1"/></body>' if name == "orientation" else ""
    )
    key = 'qpos="0 1 0 0 0"' if ball else 'qpos="0"'
    path = written(tmp_path, pendulum(actuator, body=ball, key=key))
    run = tmp_path / "run.toml"
    run.write_text(
        'case = { name = "a", title = "A" }\n[assumed]\nmodel = "model.xml"\n[assumed.activation]\norder = 1\n'
        "time_constant = 0.1\n[controller]\nq_t = 0.01\n"
    )
    new = ["new", str(path), "--out", str(tmp_path / "n.toml")]
    for command in (["linearise", str(path)], ["analyse", str(run)], new):
        assert main(command) in (1, 2)
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1


def test_a_pid_of_one_input_is_a_servo(tmp_path):
    """k_p (u − θ) − k_v θ', as that of a position servo."""
    both = ('<pid name="ankle" joint="lean" kp="900" kv="100" input="pos"/>',
            '<position name="ankle" joint="lean" kp="900" kv="100"/>')  # fmt: skip
    pid, servo = (
        load_plant(written(tmp_path, pendulum(actuator), f"{i}.xml")).linearisation.plant
        for i, actuator in enumerate(both)
    )
    for letter in "ABC":
        np.testing.assert_allclose(getattr(pid, letter), getattr(servo, letter), rtol=1e-8, atol=1e-12)
