"""What acts on a plant at its limits, against its equation of motion."""

from dataclasses import replace

import numpy as np
import pytest
from model_cases import MOTOR, pendulum, written

from icmj.controller.controller import Controller
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.engine.deviation import Deviation
from icmj.engine.plant import load_plant
from icmj.engine.run import simulate
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import list_remarks
from icmj.simulation.sources import Step

J = 6 + 70 * 0.9**2
LIMITED = {
    "control": '<motor name="ankle" joint="lean" ctrllimited="true" ctrlrange="-20 20"/>',
    "force": '<motor name="ankle" joint="lean" forcelimited="true" forcerange="-20 20"/>',
    "servo": '<position name="ankle" joint="lean" kp="50" forcelimited="true" forcerange="-20 20"/>',
}


def run(tmp_path, actuator, b=0.8, x0=0.05):
    return run_of(tmp_path, pendulum(actuator), b, x0)


def run_of(tmp_path, text, b=0.8, x0=0.05):
    path = written(tmp_path, text)
    plant = load_plant(path).linearisation.plant
    size = float(np.abs(plant.B).max())
    design = design_lq(plant, R_c=1e-4 * size**2, R_o=0.01 * size**2)
    control = Controller(design, system_matched(design), EventTrigger(output_weight(design), 5e-3, 1e-3))
    x_0 = np.append([x0], np.zeros(plant.n - 1))
    push = Step("ankle", 3 / size / J, 0.3, on="command")
    settings = Settings(duration=1.0, record_interval=0.002, disturbance=(push,))
    return simulate(load_plant(path, Deviation(b)), control, settings, x0=x_0, x_o0=x_0)


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
    (notice,) = [n for n in list_remarks(found) if n.kind == "saturation"]
    assert f"ankle {found.precision['saturated_share']:.1%}" in notice.words


ROPE = '<tendon><fixed name="rope" {}><joint joint="lean" coef="2"/></fixed></tendon>'
DIRECT = '<motor name="ankle" joint="lean" gear="2" {}/>'
PULLED = '<motor name="ankle" tendon="rope"/>'


def in_another_form(form: str) -> str:
    """The pendulum with an ankle that gives up to 20 N m, said in another way."""
    if form == "forcerange":
        return pendulum(DIRECT.format('forcelimited="true" forcerange="-10 10"'))
    if form == "tendon":
        rope = ROPE.format('actuatorfrclimited="true" actuatorfrcrange="-10 10"')
        return pendulum(PULLED).replace("<actuator>", f"{rope}<actuator>")
    torque = 'actuatorfrclimited="true" actuatorfrcrange="-20 20"'
    if form == "joint":
        return pendulum(DIRECT.format(""), joint=torque)
    return pendulum(PULLED, joint=torque).replace("<actuator>", f"{ROPE.format('')}<actuator>")


@pytest.mark.parametrize("form", ["tendon", "joint", "joint through a tendon"])
def test_a_limit_is_the_same_limit_in_whichever_form(tmp_path, form):
    """One plant, so one motion; how long it saturates, and for limits of the drive itself what acts, agree, too."""
    one, other = (run_of(tmp_path, in_another_form(name)) for name in ("forcerange", form))
    np.testing.assert_allclose(one.t, other.t, atol=1e-9)
    np.testing.assert_allclose(one.x, other.x, atol=1e-9)
    assert 0 < one.precision["saturated_share"] == other.precision["saturated_share"]
    assert one.precision["saturated"] == other.precision["saturated"]
    if form == "tendon":
        np.testing.assert_allclose(one.applied, other.applied, atol=1e-9)


def test_an_activation_at_the_end_of_its_range_is_told(tmp_path):
    lag = '<general name="ankle" joint="lean" dyntype="filter" dynprm="0.02" actlimited="true" actrange="{}"/>'
    bound, free = (run_of(tmp_path, pendulum(lag.format(ends))) for ends in ("-20 20", "-2000 2000"))
    assert free.precision["saturated_share"] == 0
    at_end = (np.abs(np.abs(bound.x[:, 2]) - 20) < 1e-9).mean()
    assert at_end > 0.05
    assert bound.precision["saturated_share"] == pytest.approx(at_end, abs=0.02)


def test_an_output_at_its_cutoff_is_told(tmp_path):
    text = pendulum(MOTOR).replace(
        '<jointpos name="angle" joint="lean"/>', '<jointpos name="angle" joint="lean" cutoff="0.04"/>'
    )
    found = run_of(tmp_path, text)
    beyond = (np.abs(found.x[:, 0]) >= 0.04).mean()
    assert 0 < beyond < 1
    assert found.precision["clipped_share"] == pytest.approx(beyond)
    assert found.precision["clipped"] == f"angle {beyond:.1%}"
    (notice,) = [n for n in list_remarks(found) if "cutoff" in n.words]
    assert notice.kind == "saturation"
    assert "clipped" not in run_of(tmp_path, pendulum(MOTOR)).precision


def test_where_nothing_saturates_the_command_and_the_disturbance_act(tmp_path):
    found = run(tmp_path, MOTOR)
    np.testing.assert_allclose(found.applied[found.t < 0.29], found.u[found.t < 0.29], rtol=1e-15)
    np.testing.assert_allclose((found.applied - found.u)[found.t > 0.31], 3.0, rtol=1e-9)
    assert "saturated_share" not in found.precision
    assert list_remarks(found) == ()


def test_a_step_that_is_too_large_is_told(tmp_path):
    path = written(tmp_path, pendulum(MOTOR).replace('timestep="0.002" integrator="RK4"', 'timestep="0.02"'))
    assumed = load_plant(path)
    size = float(np.abs(assumed.linearisation.plant.B).max())
    design = design_lq(assumed.linearisation.plant, R_c=0.01 * size**2, R_o=0.01 * size**2)
    control = Controller(design, system_matched(design), EventTrigger(output_weight(design), 5e-3, 1e-3))
    found = simulate(load_plant(path, Deviation(0.9)), control, Settings(duration=10.0, timestep=0.02), x0=[0.01, 0.0])
    (notice,) = list_remarks(found)
    assert notice.kind == "large step"
    assert "0.02 s with EULER" in notice.words
    assert 'take integrator = "RK4"' in notice.words
    (notice,) = list_remarks(replace(found, precision={**found.precision, "integrator": "RK4"}))
    assert "0.02 s with RK4" in notice.words
    assert "take integrator" not in notice.words
