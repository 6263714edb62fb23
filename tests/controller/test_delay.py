"""Delay and predictor, from the controller's data to both plants, against SciPy, finite differences and brute force."""

from dataclasses import replace

import engine_cases
import numpy as np
import pytest
from linear_cases import event_controller, ivp_run, pendulum_design, settings_from
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from theory_cases import (
    assert_multipliers_agree,
    pendulum,
    random_systems,
    started_beside,
    three_link,
    three_link_design,
)
from theory_cases import pendulum_design as paper_design

from icmj import ClockTrigger, Continuous, EventTrigger, Settings, error_system, output_weight, predict
from icmj.controller.controller import Controller, continuous_limit, make_layout, start_state
from icmj.controller.delay import Delay
from icmj.controller.hold import system_matched, zero_order
from icmj.controller.model_prediction import make_predictor
from icmj.engine.run import simulate as simulate_engine
from icmj.errors import AnalysisError, SimulationError
from icmj.linear.run import simulate as simulate_linear
from icmj.measurement.measurement import measure, measured_gamma
from icmj.theory.event_maps import compute_clocked_map, is_stable

# --- the predictor ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hold", [system_matched, zero_order])
def test_the_predictor_is_the_model_run_over_the_delay(hold) -> None:
    design = pendulum_design()
    A, B, A_h = design.plant.A, design.plant.B, hold(design).A_h
    x_o, x_h, p = np.array([0.3, -0.2]), np.array([0.1, 0.4]), np.array([-0.5, 0.7])

    def flow(t, s):
        return np.concatenate([A @ s[:2] - B @ design.k @ s[2:], A_h @ s[2:]])

    def run(state, time):
        return solve_ivp(flow, (0, time), state, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]

    end = run(np.concatenate([x_o, x_h]), 0.25)
    found = make_predictor(design, hold(design), 0.25) @ np.concatenate([x_o, x_h])
    np.testing.assert_allclose(found, end[:2], atol=1e-11)
    middle = run(np.concatenate([x_o, x_h]), 0.1)
    end = run(np.concatenate([middle[:2], p]), 0.15)
    found = make_predictor(design, hold(design), 0.25, [0.1]) @ np.concatenate([x_o, x_h, p])
    np.testing.assert_allclose(found, end[:2], atol=1e-11)


def test_without_a_delay_the_predictor_does_nothing() -> None:
    design = pendulum_design()
    np.testing.assert_array_equal(make_predictor(design, system_matched(design), 0.0), np.eye(2, 4))


def test_numbers_of_numpy_are_numbers() -> None:
    assert Delay(np.float64(0.1), np.float32(0.5)) == Delay(0.1, 0.5)
    assert bool(Delay(np.float64(0.1))) is True


def test_bad_delays_are_refused() -> None:
    for bad in (-0.1, float("nan"), float("inf")):
        with pytest.raises(AnalysisError, match="at least 0 s and finite"):
            Delay(bad)
    with pytest.raises(AnalysisError, match="0 or at least 1e-09 s, got 1e-12"):
        Delay(1e-12, 0.1)
    assert Delay(1e-9, 1e-12).predicted == 1e-12
    with pytest.raises(AnalysisError, match="assumed where none is there"):
        Delay(0.0, 0.1)
    controller = replace(event_controller(pendulum_design()), delay=Delay(0.1))
    with pytest.raises(AnalysisError, match="ClockTrigger of a small interval"):
        controller.triggered_by(Continuous())
    with pytest.raises(SimulationError, match="no event would ever act"):
        simulate_linear(pendulum(), controller, Settings(duration=0.1))


def test_the_states_that_wait_are_declared_once() -> None:
    controller = event_controller(pendulum_design())
    assert make_layout(controller).names == ("x_o", "x_h")
    assert make_layout(replace(controller, delay=Delay(0.1))).sizes == (2, 2, 2)
    clock = replace(controller, trigger=ClockTrigger(0.03))
    assert make_layout(replace(clock, delay=Delay(0.1))).sizes == (2, 2, 8)  # four ticks within the delay
    assert make_layout(replace(clock, delay=Delay(0.09))).sizes == (2, 2, 6)
    assert make_layout(replace(clock, delay=Delay(0.05, 0.1))).sizes == (2, 2, 4)  # what has acted is not remembered
    a = start_state(replace(controller, delay=Delay(0.1)), np.ones(2), np.ones(2))
    # the system-matched hold is the model under control: from x_h = x_o its prediction is the hold itself
    np.testing.assert_allclose(a[4:], expm(0.1 * pendulum_design().A_c) @ np.ones(2), rtol=1e-12)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("delay", [Delay(1e12), Delay(0.1, 1e12), Delay(0.1, 1e3), Delay(0.1, 50.0)])
def test_a_delay_that_leaves_no_digit_is_refused_in_words(delay: Delay) -> None:
    """Before anything overflows: numpy's warnings would stand on the terminal beside our line."""
    design = paper_design()
    with pytest.raises(AnalysisError, match=r"no interval is shorter|leaves no significant digit"):
        predict(error_system(pendulum(0.8), design, delay=delay), EventTrigger(output_weight(design), 0.01))
    growth = np.linalg.eigvals(design.plant.A).real.max() * delay.predicted
    assert growth > -np.log(np.finfo(float).eps)


# --- theory ----------------------------------------------------------------------------------------------------------


def test_values_confirmed_by_direct_simulation_elsewhere() -> None:
    for plant, design, delta, kind, other in (
        (pendulum(0.8), paper_design(), 1.820338, 1, 0.297),
        (three_link(1.1), three_link_design(), 0.768044, -1, 0.547),
    ):
        system = error_system(plant, design, delay=Delay(0.1))
        found = predict(system, EventTrigger(output_weight(design), 0.01))
        assert found.delta_crit == pytest.approx(delta, abs=1.1e-6)
        assert found.eigenvalue == kind
        assert found.crossings[0].largest_other == pytest.approx(other, abs=1e-3)
        assert found.verdict == "attracting"
        assert found.observer_feedback_stable


def test_a_vanishing_delay_is_the_paper_s_loop() -> None:
    design = three_link_design()
    rule = EventTrigger(output_weight(design), 0.01)
    paper = predict(error_system(three_link(0.9), design), rule)
    tiny = predict(error_system(three_link(0.9), design, delay=Delay(1e-7)), rule)
    assert tiny.delta_crit == pytest.approx(paper.delta_crit, rel=1e-5)
    np.testing.assert_allclose(tiny.amplitude, paper.amplitude, rtol=1e-4)
    np.testing.assert_allclose(np.abs(tiny.multipliers[:10]), np.abs(paper.multipliers[:10]), atol=2e-4)


def delayed_systems(seed: int, count: int):
    """Random systems with random delays, two in three of them mismatched."""
    random = np.random.default_rng(seed)
    for system in random_systems(seed, count):
        t_d = 10 ** random.uniform(-2, -0.3)
        assumed = t_d * random.choice([1.0, 0.8, 1.3])
        yield error_system(system.actual, system.design, delay=Delay(t_d, assumed))


@pytest.mark.parametrize("assumed", [0.1, 0.08, 0.13])
@pytest.mark.parametrize("b", [0.9, 1.1])
def test_shipped_multipliers_are_those_of_finite_differences(b: float, assumed: float) -> None:
    design = three_link_design()
    system = error_system(three_link(b), design, delay=Delay(0.1, assumed))
    rule = EventTrigger(output_weight(design), 0.01)
    prediction = predict(system, rule)
    assert prediction.orbit is not None
    assert_multipliers_agree(system, rule, prediction)


@pytest.mark.slow
def test_random_plants_and_delays_agree_with_theory_and_simulation() -> None:
    """Multipliers by finite differences; interval, γ and attraction by the exact simulation, on fifty and more."""
    multipliers, cycles, repelling, wrong = 0, 0, 0, []
    for i, system in enumerate(delayed_systems(7, 1200)):
        rule = EventTrigger(np.eye(system.n_hat), 0.01, 1e-4)
        prediction = predict(system, rule, delta_max=2.0 + system.delay.t_d)
        if prediction.verdict not in ("attracting", "repelling"):
            continue
        largest = np.abs(prediction.multipliers).max()
        if multipliers < 40 and largest < 1e3:
            assert_multipliers_agree(system, rule, prediction)
            multipliers += 1
        if 0.9 <= largest <= 1.1:
            continue
        run, attracted = started_beside(system, rule, prediction, i)
        repelling += largest > 1
        if attracted != (largest < 1):
            wrong.append((i, float(largest)))
        if attracted and prediction.cycle and largest < 0.7:
            assert run.events.interval[-1] == pytest.approx(prediction.delta_crit, rel=1e-9)
            assert measured_gamma(run, prediction.V_inv, system.T_hat) == pytest.approx(prediction.gamma, rel=1e-9)
        cycles += 1
        if cycles >= 50 and multipliers >= 40:
            break
    assert (cycles, multipliers) >= (50, 40)
    assert repelling >= 4
    assert wrong == []


# --- linear plant ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("assumed", [0.1, 0.06, 0.15])
@pytest.mark.parametrize("hold", ["system-matched", "zero-order"])
@pytest.mark.parametrize("delta_min", [0.01, 0.3])
def test_linear_events_are_those_of_scipy(assumed: float, hold: str, delta_min: float) -> None:
    plant = pendulum(0.8)
    controller = event_controller(paper_design(), delta_min=delta_min, hold=hold)
    controller = replace(controller, delay=Delay(0.1, assumed))
    run = simulate_linear(plant, controller, Settings(duration=8.0, limit=1e6), x0=[0.0, 0.02])
    times, *_ = ivp_run(plant, controller, 8.0, np.array([0.0, 0.02]), np.zeros(2))
    assert len(times) >= 3
    np.testing.assert_allclose(run.events.t, times, atol=1e-9)


def test_the_predicted_cycle_is_reached_and_measured() -> None:
    design = three_link_design()
    for b in (0.9, 1.1):
        plant, rule = three_link(b), EventTrigger(output_weight(design), 0.01, 0.01)
        controller = Controller(design, system_matched(design), rule, Delay(0.1))
        system = error_system(plant, design, delay=controller.delay)
        prediction = predict(system, rule)
        run = simulate_linear(plant, controller, Settings(duration=60.0, limit=1e6), x0=0.01 * np.eye(6)[3])
        motion = measure(run, T_hat=system.T_hat)
        assert motion.kind == "cycle"
        assert motion.mirrored == (b > 1)
        assert motion.interval == pytest.approx(prediction.delta_crit, rel=1e-9)
        assert measured_gamma(run, prediction.V_inv, system.T_hat) == pytest.approx(prediction.gamma, rel=1e-9)
        np.testing.assert_allclose(motion.amplitude, prediction.amplitude, rtol=1e-8)


# --- a clock faster than the delay -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("interval", "assumed"), [(0.03, 0.1), (0.025, 0.1), (0.03, 0.13), (0.03, 0.07), (0.3, 0.1)])
def test_clocks_follow_the_clocked_map(interval: float, assumed: float) -> None:
    plant, design = pendulum(0.8), paper_design()
    controller = Controller(design, system_matched(design), ClockTrigger(interval), Delay(0.1, assumed))
    # at rest, predictions that are not there yet are those of a hold at rest
    x, x_o = np.array([0.1, 0.02]), np.zeros(2)
    run = simulate_linear(plant, controller, Settings(duration=1.4, limit=1e6), x0=x, x_o0=x_o)
    state, step = np.concatenate([x, start_state(controller, x_o, x_o)]), compute_clocked_map(plant, controller)
    for i in range(len(run.events)):
        state = step @ state
        found = np.concatenate([run.events.x[i], run.events.x_o[i], run.events.x_h[i]])
        np.testing.assert_allclose(found, state[:6], atol=1e-12)


def test_a_fast_clock_is_the_continuous_predictor_controller() -> None:
    """u(t) = −k̂ x_p(t), x_p the model's prediction from t − t_d by the controls under way: integrated on a grid."""
    plant, design, t_d = pendulum(0.8), paper_design(), 0.1
    x0 = np.array([0.0, 0.05])
    ends = []
    for interval in (0.01, 0.005, 0.0025):
        controller = Controller(design, system_matched(design), ClockTrigger(interval), Delay(t_d))
        run = simulate_linear(plant, controller, Settings(duration=2.0, limit=1e6), x0=x0)
        ends.append(run.x[-1])
    h, steps = 2.5e-4, 8000
    lag, A, B, k = round(t_d / h), design.plant.A, design.plant.B, design.k
    model = expm(np.block([[A, B], [np.zeros((1, 3))]]) * h)
    actual = expm(np.block([[plant.A, plant.B], [np.zeros((1, 3))]]) * h)
    watch = expm(np.block([[A - design.L @ design.plant.C, B, design.L], [np.zeros((2, 4))]]) * h)
    # the prediction over the delay: free motion plus what the controls of the last delay add
    weights = np.array([np.linalg.matrix_power(model, lag - 1 - j)[:2, :2] @ model[:2, 2] for j in range(lag)])
    free = np.linalg.matrix_power(model, lag)[:2, :2]
    x, x_o, under_way = x0.copy(), np.zeros(2), np.zeros(lag)
    for _ in range(steps):
        command = float((-k @ (free @ x_o + under_way @ weights))[0])
        u, under_way = under_way[0], np.append(under_way[1:], command)
        y = float((plant.C @ x)[0])
        x_o = (watch @ np.concatenate([x_o, [u, y]]))[:2]
        x = (actual @ np.append(x, u))[:2]
    gaps = np.linalg.norm(np.array(ends) - x, axis=1)
    assert gaps[0] > 1.6 * gaps[1] > 2.5 * gaps[2]
    assert gaps[2] < 0.02 * np.linalg.norm(x)


def test_stability_under_a_delay() -> None:
    plant, design = pendulum(0.8), paper_design()
    assert is_stable(plant, _limit(design, 0.1))
    assert not is_stable(pendulum(1.6), _limit(design, 1.5))


def _limit(design, t_d: float) -> Controller:
    controller = Controller(design, system_matched(design), EventTrigger(np.eye(2), 0.01), Delay(t_d))
    return controller.triggered_by(continuous_limit(controller))


# --- the engine ------------------------------------------------------------------------------------------------------


DELAYS = [Delay(0.1), Delay(0.1, 0.104), Delay(0.05, 0.047)]


@pytest.mark.parametrize("delay", DELAYS, ids=str)
@pytest.mark.parametrize("trigger", ["rule", "clock", "fast clock", "tick"])
def test_engine_and_linear_plant_agree_at_small_sway(delay: Delay, trigger: str) -> None:
    body, control = engine_cases.plant("three_link", 0.9), engine_cases.controller("three_link", 1e-4)
    clocks = {"clock": 0.21, "fast clock": 0.031, "tick": 0.025}
    if trigger in clocks:
        control = replace(control, trigger=ClockTrigger(clocks[trigger]))
    control = replace(control, delay=delay)
    settings = settings_from({
        "duration": 3.0, "timestep": 1e-3,
        "disturbance": [{"kind": "impulse", "input": "hip_torque", "size": 1e-4, "start": 0.5003, "duration": 0.05}],
    })  # fmt: skip
    x0 = 1e-4 * np.ones(6)
    engine = simulate_engine(body, control, settings, x0=x0)
    linear = simulate_linear(body.linearisation.plant, control, settings, x0=x0)
    assert len(engine.events) == len(linear.events) >= 3
    np.testing.assert_allclose(engine.events.t, linear.events.t, atol=1e-6)
    scale = np.abs(linear.events.x).max(axis=0)
    assert (np.abs(engine.events.x - linear.events.x) / scale).max() < 1e-4
    assert (np.abs(engine.events.y_max - linear.events.y_max) / np.abs(linear.events.y_max).max()).max() < 1e-4


def test_event_and_action_times_are_fourth_order() -> None:
    body = engine_cases.plant("three_link", 0.9)
    control = replace(engine_cases.controller("three_link"), delay=Delay(0.1003))

    def run(h: float):
        found = simulate_engine(body, control, Settings(duration=4.0, timestep=h), x0=0.01 * np.ones(6))
        jumps = np.flatnonzero(np.isin(found.t, found.events.t + 0.1003))
        return found.events.t, found.x_h[jumps[:3]]

    exact, acted = run(2.5e-4)
    runs = [run(h) for h in (8e-3, 4e-3, 2e-3)]
    assert len(exact) >= 4
    assert len(acted) == 3  # an action falls on its time to the last bit
    errors = [np.abs(times - exact).max() for times, _ in runs]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 3.7) & (orders < 4.8)), orders
    errors = [np.abs(held - acted).max() for _, held in runs]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 3.5) & (orders < 4.9)), orders


@pytest.mark.slow
@pytest.mark.parametrize("b", [0.9, 1.1])
def test_the_engine_s_error_falls_with_the_square_of_the_threshold(b: float) -> None:
    body, thresholds, errors = engine_cases.plant("three_link", b), np.geomspace(1e-2, 1e-4, 5), []
    for q_t in thresholds:
        control = replace(engine_cases.controller("three_link", q_t), delay=Delay(0.1))
        linear = body.linearisation.plant
        system = error_system(linear, control.design, control.hold, delay=control.delay)
        prediction = predict(system, control.trigger)
        x, x_o, x_h = system.start(prediction.orbit.x_bar)
        settings = Settings(duration=24 * prediction.delta_crit, timestep=5e-4, record_interval=1.0)
        run = simulate_engine(body, control, settings, x0=x, x_o0=x_o, x_h0=x_h, error_estimate=False)
        errors.append(run.events.interval[-1] / prediction.delta_crit - 1)
    slope = np.polyfit(np.log(thresholds), np.log(np.abs(errors)), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.05)


def test_realisation_without_a_delay_has_no_further_state() -> None:
    found = event_controller(pendulum_design()).realisation
    assert found.layout.size == 4
    assert found.delay == 0
    np.testing.assert_array_equal(found.G, np.eye(4))


@pytest.mark.parametrize(("late", "trigger", "words"), [
    (-0.1, None, "at least 1e-09 s"), (1e-12, None, "at least 1e-09 s"), (np.inf, None, "finite"),
    ("0.1", None, "finite"), (0.1, ClockTrigger(0.2), "kind 'clock' has none"),
    (0.1, Continuous(), "kind 'continuous' has none"),
])  # fmt: skip
def test_a_sampling_delay_that_cannot_be_is_refused_in_one_line(late, trigger, words) -> None:
    of = event_controller(pendulum_design(), q_t=0.01)
    with pytest.raises(AnalysisError, match=words):
        replace(of, trigger=trigger or of.trigger, sampling_delay=late)


def test_a_sampling_delay_is_of_the_event_rule_alone_and_part_of_the_least_interval() -> None:
    of = replace(event_controller(pendulum_design(), q_t=0.01), delay=Delay(0.1), sampling_delay=0.05)
    assert of.triggered_by(ClockTrigger(0.2)).sampling_delay == 0
    assert of.triggered_by(of.trigger).sampling_delay == 0.05
    assert of.least == pytest.approx(0.15)
    assert of.wait == 0.1
    seldom = of.triggered_by(replace(of.trigger, delta_min=0.4))
    assert (seldom.least, seldom.wait) == pytest.approx((0.4, 0.35))
