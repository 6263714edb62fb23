"""What of a plant depends on the model's time step is told with the size of its effect; what does not is not."""

import numpy as np
import pytest
from model_cases import MOTOR, SERVO, pendulum, written

from icmj import load_plant
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
