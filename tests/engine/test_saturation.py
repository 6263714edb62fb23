"""What acts on a plant at its limits, against its equation of motion."""

from __future__ import annotations

import numpy as np
import pytest
from model_cases import MOTOR, pendulum, written

from icmj.controller.controller import Controller
from icmj.controller.design import design_lq
from icmj.controller.hold import system_matched
from icmj.controller.trigger import EventTrigger, output_weight
from icmj.engine.deviation import Deviation
from icmj.engine.plant import load_plant
from icmj.engine.run import simulate
from icmj.simulation.remarks import remarks
from icmj.simulation.settings import Settings, Step

J = 6 + 70 * 0.9**2
LIMITED = {
    "control": '<motor name="ankle" joint="lean" ctrllimited="true" ctrlrange="-20 20"/>',
    "force": '<motor name="ankle" joint="lean" forcelimited="true" forcerange="-20 20"/>',
    "servo": '<position name="ankle" joint="lean" kp="50" forcelimited="true" forcerange="-20 20"/>',
}


def run(tmp_path, actuator, b=0.8, x0=0.05):
    path = written(tmp_path, pendulum(actuator))
    plant = load_plant(path).linearisation.plant
    size = float(np.abs(plant.B).max())
    design = design_lq(plant, R_c=1e-4 * size**2, R_o=0.01 * size**2)
    control = Controller(design, system_matched(design), EventTrigger(output_weight(design), 5e-3, 1e-3))
    settings = Settings(duration=1.0, record_interval=0.002, disturbance=(Step("ankle", 3 / size / J, 0.3),))
    return simulate(load_plant(path, Deviation(b)), control, settings, x0=[x0, 0.0], x_o0=[x0, 0.0])


@pytest.mark.parametrize("kind", LIMITED)
def test_what_is_applied_is_what_moves_the_plant(tmp_path, kind):
    """J θ'' = m g l sin θ + torque of what is said to act: its integral over each row is the change of θ'."""
    found = run(tmp_path, LIMITED[kind])
    θ, v, b = found.x[:, 0], found.x[:, 1], 0.8
    torque = b * found.applied[:, 0] if kind != "servo" else 50 * (b * found.applied[:, 0] - θ)
    assert np.abs(torque).max() == pytest.approx(20)
    assert np.abs(b * found.u).max() > (20 if kind != "servo" else 20 / 50)
    force = (70 * 9.81 * 0.9 * np.sin(θ) + torque) / J
    # rows at jumps of the command are left out: the value there is the one before
    dt = np.diff(found.t)
    smooth = np.abs(np.diff(torque)) < 1
    change = (force[1:] + force[:-1]) / 2 * dt
    np.testing.assert_allclose(np.diff(v)[smooth], change[smooth], atol=2e-5)
    assert smooth.mean() > 0.9
    (notice,) = [n for n in remarks(found) if n.kind == "saturation"]
    assert f"ankle {found.precision['saturated_share']:.1%}" in notice.words


def test_where_nothing_saturates_the_command_and_the_disturbance_act(tmp_path):
    found = run(tmp_path, MOTOR)
    np.testing.assert_allclose(found.applied[found.t < 0.29], found.u[found.t < 0.29], rtol=1e-15)
    np.testing.assert_allclose((found.applied - found.u)[found.t > 0.31], 3.0, rtol=1e-9)
    assert "saturated_share" not in found.precision
    assert remarks(found) == ()


def test_a_step_that_is_too_large_is_told(tmp_path):
    path = written(tmp_path, pendulum(MOTOR).replace('timestep="0.002" integrator="RK4"', 'timestep="0.02"'))
    assumed = load_plant(path)
    size = float(np.abs(assumed.linearisation.plant.B).max())
    design = design_lq(assumed.linearisation.plant, R_c=0.01 * size**2, R_o=0.01 * size**2)
    control = Controller(design, system_matched(design), EventTrigger(output_weight(design), 5e-3, 1e-3))
    found = simulate(load_plant(path, Deviation(0.9)), control, Settings(duration=10.0, timestep=0.02), x0=[0.01, 0.0])
    (notice,) = remarks(found)
    assert notice.kind == "large step"
    assert "0.02 s with EULER" in notice.words
