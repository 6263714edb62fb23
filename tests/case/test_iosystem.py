"""Loops as systems of python-control do what the simulators of the package do, by another program's arithmetic."""

from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
import pytest
from report_cases import actual_plant, design_of

import icmj
from icmj import Controller, Delay, Settings, Step, error_system, system_matched
from icmj.controller.design import output_weight
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import ClockTrigger, Continuous
from icmj.errors import AnalysisError

X0 = [0.02, 0.0]
PUSH = 0.003


def controller(trigger=None, **more):
    design = design_of("b0.8")
    rule = trigger or EventTrigger(output_weight(design), 0.01, 0.01)
    return Controller(design, system_matched(design), rule, **more)


def run(control_, record=0.01, duration=6.0, plant=None, **more):
    settings = Settings(duration=duration, record_interval=record, **more)
    return icmj.simulate_plant(plant or actual_plant("b0.8"), control_, settings, x0=X0, x_o0=[0, 0])


def test_continuous_control_is_a_state_space():
    loop = icmj.to_iosystem(actual_plant("b0.8"), controller(Continuous()))
    assert isinstance(loop, control.StateSpace)
    assert loop.input_labels == ["d_torque", "n_angle"]
    assert loop.output_labels == ["angle", "u_torque"]
    assert loop.state_labels == ["hinge", "hinge_rate", "x_o_hinge", "x_o_hinge_rate"]
    simulation = run(controller(Continuous()), disturbance=(Step("torque", PUSH, on="command"),))
    found = control.forced_response(loop, simulation.t, [PUSH + 0 * simulation.t, 0 * simulation.t], [*X0, 0, 0])
    assert found.outputs[0] == pytest.approx(simulation.y[:, 0], abs=1e-9)
    assert found.outputs[1] == pytest.approx(simulation.u[:, 0], abs=1e-8)


def test_a_clock_is_a_state_space_in_discrete_time_with_the_eigenvalues_of_phi():
    interval = 0.37
    control_ = controller(ClockTrigger(interval))
    loop = icmj.to_iosystem(actual_plant("b0.8"), control_)
    assert loop.dt == interval
    phi = error_system(actual_plant("b0.8"), control_.design).phi(interval)
    assert np.sort_complex(loop.poles()) == pytest.approx(np.sort_complex(np.linalg.eigvals(phi)), abs=1e-9)
    simulation = run(control_, disturbance=(Step("torque", PUSH, on="command"),))
    t = interval * np.arange(len(simulation.events) + 1)
    found = control.forced_response(loop, t, [PUSH + 0 * t, 0 * t], [*X0, 0, 0])
    assert pytest.approx(simulation.events.x, abs=1e-9) == found.states[:2, 1:].T
    assert pytest.approx(simulation.events.x_o, abs=1e-9) == found.states[2:, 1:].T


@pytest.mark.parametrize("dt", [4e-3, 7e-4])
def test_an_event_rule_looked_at_often_is_late_by_no_more_than_a_look(dt):
    control_ = controller()
    loop = icmj.to_iosystem(actual_plant("b0.8"), control_, dt=dt)
    t = dt * np.arange(round(8.0 / dt) + 1)
    found = control.input_output_response(loop, t, np.zeros((2, len(t))), [*X0, 0, 0, 0, 0, 0])
    events = np.append(0, np.flatnonzero(np.diff(found.states[-1]) < 0.5 * dt))
    assert len(events) >= 4
    # from each of its events the exact simulation finds the next one less than a look earlier
    for this, following in pairwise(events):
        x, x_o = found.states[:2, this], found.states[2:4, this]
        settings = Settings(duration=8.0)
        exact = icmj.simulate_plant(actual_plant("b0.8"), control_, settings, x0=x, x_o0=x_o).events.t[0]
        assert -1e-9 <= t[following] - t[this] - exact <= dt
    assert found.outputs[1, events[1]] == pytest.approx(-(control_.design.k @ found.states[2:4, events[1]])[0])


def test_a_model_on_the_engine_is_nonlinear_and_near_rest_its_linearisation(root):
    plant = icmj.load_plant(root / "models" / "three_link.xml", keyframe="upright")
    system = icmj.to_iosystem(plant)
    assert isinstance(system, control.NonlinearIOSystem)
    linear = plant.linearisation.plant
    found = system.linearize(np.zeros(6), np.zeros(3), eps=1e-5)
    # python-control takes one-sided differences
    assert np.abs(found.A - linear.A).max() < 1e-4 * np.abs(linear.A).max()
    assert np.abs(found.B - linear.B).max() < 1e-4 * np.abs(linear.B).max()
    assert pytest.approx(linear.C, abs=1e-8) == found.C
    assert tuple(system.state_labels) == linear.states


def test_a_loop_on_the_engine_is_the_simulated_one(root):
    plant = icmj.load_plant(root / "models" / "three_link.xml", keyframe="upright")
    linear = plant.linearisation.plant
    design = icmj.design_lq(linear, R_c=5e-7, R_o=2e-7)
    control_ = Controller(design, system_matched(design), Continuous())
    settings = Settings(duration=0.4, initial={"ankle": 0.1}, record_interval=0.02, timestep=1e-3, integrator="RK4")
    simulation = icmj.simulate_plant(plant, control_, settings)
    loop = icmj.to_iosystem(plant, control_)
    start = np.zeros(12)
    start[0] = 0.1
    t = simulation.t
    exact = {"rtol": 1e-9, "atol": 1e-12}
    found = control.input_output_response(loop, t, np.zeros((6, len(t))), start, solve_ivp_kwargs=exact)
    assert pytest.approx(simulation.y, abs=1e-7) == found.outputs[:3].T
    assert pytest.approx(simulation.u, abs=1e-4) == found.outputs[3:].T


def test_a_ball_joint_turns_as_the_engine_turns_it(tmp_path):
    model = tmp_path / "ball.xml"
    model.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="b" type="ball"/>'
        '<geom size="0.1" mass="1"/></body></worldbody>'
        '<actuator><motor name="m" joint="b" gear="1 0 0"/></actuator>'
        '<sensor><ballquat name="q" joint="b"/></sensor></mujoco>'
    )
    from icmj.engine.dynamics import Dynamics

    dynamics = Dynamics(icmj.load_plant(model))
    # about one axis the departure grows at the speed; across it, as the inverse of the right Jacobian says
    turned, speed = np.array([0.8, 0.0, 0.0]), np.array([0.3, 0.5, -0.2])
    rate = dynamics(np.concatenate([turned, speed]), np.zeros(1))[0][:3]
    angle = np.linalg.norm(turned)
    across = np.cross(turned, speed)
    exact = (
        speed
        + across / 2
        + (1 / angle**2 - (1 + np.cos(angle)) / (2 * angle * np.sin(angle))) * np.cross(turned, across)
    )
    assert rate == pytest.approx(exact, abs=1e-8)


def test_plants_of_cases_have_such_a_form_and_events_inside_the_steps_of_the_engine_none(root):
    assert isinstance(icmj.to_iosystem(actual_plant("b0.8")), control.StateSpace)
    case = icmj.prepare(icmj.load_run(root / "runs" / "simple-0.8.toml"))
    assert isinstance(icmj.to_iosystem(case.actual), control.NonlinearIOSystem)
    with pytest.raises(AnalysisError, match="has events inside its steps"):
        icmj.to_iosystem(case.actual, case.controller, dt=1e-3)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: icmj.to_iosystem(actual_plant("b0.8"), controller()), "needs dt"),
    (lambda: icmj.to_iosystem(actual_plant("b0.8"), controller(), dt=0.0), "dt must be positive"),
    (lambda: icmj.to_iosystem(actual_plant("b0.8"), controller(Continuous()), dt=0.1), "a continuous trigger has"),
    (lambda: icmj.to_iosystem(actual_plant("b0.8"), controller(delay=Delay(0.1, 0.1)), dt=0.1), "with a delay"),
    (
        lambda: icmj.to_iosystem(actual_plant("b0.8"), controller(ClockTrigger(0.5), delay=Delay(0.1, 0.1))),
        "with a delay",
    ),
])  # fmt: skip
def test_what_has_no_such_form_is_refused(make, words):
    with pytest.raises(AnalysisError, match=words):
        make()


def test_names_have_no_points():
    plant = replace(actual_plant("b0.8"), outputs=("foot.angle",))
    assert icmj.to_iosystem(plant, controller(Continuous()), match="position").output_labels[0] == "foot_angle"
