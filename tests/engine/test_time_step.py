"""What of a plant depends on the model's time step is told with the size of its effect; what does not is not."""

from math import factorial

import numpy as np
import pytest
from model_cases import MOTOR, SERVO, pendulum, written
from scipy.linalg import expm

from icmj import Controller, EventTrigger, Settings, design_lq, load_plant, system_matched
from icmj.engine.run import simulate
from icmj.plant.body import OperatingRule
from icmj.plant.quality import STEADY

J, WEIGHT = 70 * 0.9**2 + 6, 70 * 9.81 * 0.9
GEAR, K, R, L = 60.0, 0.5, 0.1, 0.002
ELECTRIC = '<dcmotor name="ankle" joint="lean" gear="{}" motorconst="{}" resistance="{}" inductance="{}"/>'
STIFF = 'range="-0.1 0.1" solreflimit="{} 1"'


def response(h, omega):
    """θ/u of a rod with L di/dt = u − R i − K N θ̇ and the torque N K of the current at the end of a step, actearly.

    With the voltages held over the step this is i + τ (1 − exp(−h/τ)) di/dt, τ = L/R.
    """
    s, tau = 1j * omega, L / R
    # i (L s + R) = u − K N s θ;  J s² θ = W θ + N K i_end
    drive = GEAR * K * (1 + tau * -np.expm1(-h / tau) * s)
    return drive / ((L * s + R) * (J * s**2 - WEIGHT) + drive * K * GEAR * s)


@pytest.mark.parametrize("h", [0.004, 0.002, 1e-4])
def test_a_motor_with_inductance_is_told_with_the_effect_of_its_step(tmp_path, h):
    text = pendulum(ELECTRIC.format(GEAR, K, R, L)).replace('timestep="0.002"', f'timestep="{h}"')
    plant = load_plant(written(tmp_path, text), keyframe="stand")
    effect = plant.quality.step_effect
    assert (effect.input, effect.output, effect.step) == ("ankle", "angle", h)
    known = abs(response(h, effect.omega) / response(h / 2, effect.omega) - 1)
    assert effect.share == pytest.approx(known, rel=1e-4)
    (notice,) = [notice for notice in plant.quality.notices if notice.kind == "time step"]
    assert notice.severity == "warning"
    assert f"depend on its time step of {h:g} s: half of it changes the response of angle to ankle" in notice.words


def test_a_step_that_is_small_enough_needs_no_word(tmp_path):
    text = pendulum(ELECTRIC.format(GEAR, K, R, L)).replace('timestep="0.002"', 'timestep="1e-6"')
    assert load_plant(written(tmp_path, text), keyframe="stand").quality.step_effect is None


@pytest.mark.parametrize(("time", "held"), [(0.002, True), (0.02, False)])
def test_a_stop_that_is_faster_than_two_steps_is_told(tmp_path, time, held):
    """The engine makes the time constant of a stop at least two of its steps."""
    path = written(tmp_path, pendulum(MOTOR, joint=STIFF.format(time), key='qpos="0.1001"'))
    effect = load_plant(path, keyframe="stand").quality.step_effect
    assert (effect is not None and effect.share > STEADY) == held


@pytest.mark.parametrize("actuator", [MOTOR, SERVO, '<motor name="ankle" joint="lean" gear="1e-6"/>'])
@pytest.mark.parametrize("joint", ["", 'stiffness="9000"', 'stiffness="618.03"'])
def test_other_plants_do_not_depend_on_it(tmp_path, actuator, joint):
    """Also one that swings undamped, and one that hardly falls."""
    plant = load_plant(written(tmp_path, pendulum(actuator, joint=joint)), keyframe="stand")
    assert plant.quality.step_effect is None
    assert np.isfinite(plant.linearisation.plant.response(1j)).all()


H = 0.002  # s, of the model file
SOLVED = 'solimp="0.95 0.95 0.001"'  # the impedance is the same at any violation
RESTING = f"""
<mujoco>
  <compiler angle="radian"/><option timestep="{H}" integrator="{{integrator}}"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" solref="{{floor}} 1" {SOLVED}/>
    <body name="block" pos="0 0 0.1"><joint name="z" type="slide" axis="0 0 1"/>
      <geom name="sole" type="sphere" size="0.1" mass="2" condim="1" solref="{{sole}} 1" {SOLVED}/></body>
  </worldbody>
  <actuator><motor name="lift" joint="z"/></actuator>
  <sensor><jointpos name="height" joint="z"/></sensor>
</mujoco>"""
LINKS = f"""
<mujoco>
  <compiler angle="radian"/><option timestep="{H}" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="low"><joint name="low" axis="0 1 0"/><inertial pos="0 0 0.4" mass="30" diaginertia="2 2 1"/>
      <body name="high" pos="0 0 0.8"><joint name="high" axis="0 1 0"/>
        <inertial pos="0 0 0.4" mass="40" diaginertia="3 3 1"/></body></body>
    <body name="rod" pos="0.2 0 0"><joint name="rod" axis="0 1 0"/>
      <inertial pos="0 0 0.4" mass="1" diaginertia="0.1 0.1 0.1"/></body>
  </worldbody>
  <tendon><fixed name="sum"><joint joint="low" coef="1"/><joint joint="high" coef="2"/></fixed></tendon>
  <equality>{{}}</equality>
  <actuator><motor name="ankle" joint="low"/></actuator>
  <sensor><jointpos name="angle" joint="low"/></sensor>
</mujoco>"""
TIED = {
    "joints": '<joint joint1="high" joint2="low" {0}/><joint joint1="rod" joint2="low" {0}/>',
    "tendon": '<tendon tendon1="sum" {0}/><joint joint1="rod" joint2="low" {0}/>',
    "chain": '<joint joint1="high" joint2="low" {0}/><connect body1="rod" body2="high" anchor="-0.2 0 0.8" {0}/>',
}


def departs(plant, x0, step, duration=0.04, integrator="RK4"):
    """The states of the plant without a command, at every 4 ms, after a start beside rest."""
    gains = design_lq(plant.linearisation.plant)
    control = Controller(gains, system_matched(gains), EventTrigger(np.eye(len(x0)), 1e3, delta_min=0.0))
    settings = Settings(duration=duration, timestep=step, integrator=integrator, record_interval=0.004)
    run = simulate(plant, control, settings, x0=x0, x_o0=np.zeros(len(x0)), error_estimate=False)
    assert not len(run.events.t)
    return run


def agree(plant, A, x0, step):
    """Whether a run is what the classical method of Runge and Kutta makes of ẋ = A x, and so the plant's at its order.

    To 1e-5 of each state's largest value: derivatives are differences, and sines of 1e-5 rad are not linear.
    """
    run, z = departs(plant, x0, step), step * A
    of = [np.linalg.matrix_power(z, k) / factorial(k) for k in range(5)]
    exact = np.array([np.linalg.matrix_power(sum(of), round(t / step)) @ x0 for t in run.t])
    assert (np.abs(run.x - exact).max(axis=0) < 1e-5 * np.abs(exact).max(axis=0)).all()


@pytest.mark.parametrize("part", [1, 2, 10])
@pytest.mark.parametrize(("floor", "sole"), [(5e-4, 5e-4), (5e-4, 0.02), (5e-3, 2e-3), (0.05, 0.05)])
def test_a_contact_is_as_stiff_in_every_run_as_the_model_s_own_step_makes_it(tmp_path, floor, sole, part):
    """The engine mixes time constants, and then raises what comes of it to two steps: z̈ = −2 ż/T − z/T²."""
    text = RESTING.format(floor=floor, sole=sole, integrator="RK4")
    plant = load_plant(written(tmp_path, text), operating=OperatingRule("balance"))
    T = max((floor + sole) / 2, 2 * H)
    A = np.array([[0, 1], [-1 / T**2, -2 / T]])
    np.testing.assert_allclose(plant.linearisation.plant.A, A, rtol=1e-6)
    agree(plant, A, np.array([1e-7, 0.0]), H / part)
    words = [notice.words for notice in plant.quality.notices if "raised" in notice.words]
    assert bool(words) == ((floor + sole) / 2 < 2 * H)
    if words:
        assert words[0].startswith(f"the time constant of floor and sole ({(floor + sole) / 2:g} s) is raised to 0.004")


@pytest.mark.parametrize("part", [1, 2, 10])
@pytest.mark.parametrize("time", [5e-4, 5e-3, 0.05])
@pytest.mark.parametrize("tied", TIED)
def test_tied_joints_tendons_and_closed_chains_are_one_plant_at_all_steps(tmp_path, tied, time, part):
    text = LINKS.format(TIED[tied].format(f'solref="{time} 1" {SOLVED}'))
    plant = load_plant(written(tmp_path, text))
    x0 = np.zeros(plant.linearisation.plant.n)
    x0[:3] = 1e-7, -1e-7, 2e-7  # the ties are pulled, too
    agree(plant, plant.linearisation.plant.A, x0, H / part)
    assert any("raised" in notice.words for notice in plant.quality.notices) == (time < 2 * H)


def test_a_motor_with_early_activation_is_one_plant_at_all_steps(tmp_path):
    """A filter whose force is that of a step later, which is the model's step."""
    tau = 0.01
    lag = (
        f'<general name="ankle" joint="lean" dyntype="filter" dynprm="{tau}" gainprm="50" '
        'actearly="true" actlimited="true" actrange="-9 9"/>'
    )
    plant = load_plant(written(tmp_path, pendulum(lag)), keyframe="stand")
    A = np.array([[0, 1, 0], [WEIGHT / J, 0, 50 * (1 - H / tau) / J], [0, 0, -1 / tau]])
    np.testing.assert_allclose(plant.linearisation.plant.A, A, rtol=1e-6, atol=1e-7)
    for part in (1, 2, 10):
        agree(plant, A, np.array([1e-5, 0.0, 1e-3]), H / part)


def test_a_plant_of_the_discrete_integrator_is_that_of_its_rates(tmp_path):
    """Its accelerations are those of a step; what is linearised is what its steps, and all others, tend to."""
    texts = [pendulum(SERVO).replace('"RK4"', f'"{name}"') for name in ("RK4", "discrete")]
    one, other = (load_plant(written(tmp_path, text, f"{i}.xml"), keyframe="stand") for i, text in enumerate(texts))
    np.testing.assert_array_equal(one.linearisation.plant.A, other.linearisation.plant.A)
    stiff = load_plant(
        written(tmp_path, RESTING.format(floor=3e-3, sole=3e-3, integrator="discrete")),
        operating=OperatingRule("balance"),
    )
    A, x0 = np.array([[0, 1], [-1 / 3e-3**2, -2 / 3e-3]]), np.array([1e-7, 0.0])
    np.testing.assert_allclose(stiff.linearisation.plant.A, A, rtol=1e-6)
    errors = []
    for h in (2e-5, 1e-5):  # of first order
        run = departs(stiff, x0, h, 0.004, "discrete")
        errors.append(np.abs(run.x[-1, 0] - (expm(A * run.t[-1]) @ x0)[0]) / x0[0])
    assert errors[1] < 0.6 * errors[0] < 0.01
