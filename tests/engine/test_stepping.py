"""Steps that are chosen for a tolerance: against SciPy's DOP853 on ``mj_forward``."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine_cases import controller, orbit_start, plant, predicted
from linear_cases import settings_from
from model_cases import MOTOR, RICH, pendulum, written
from oracles.engine import course, equations, flight

from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.design import design_lq, output_weight
from icmj.controller.hold import system_matched
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import ClockTrigger, Continuous, Trigger
from icmj.engine.accuracy import choose_timestep, estimate
from icmj.engine.closed_loop import close_loop
from icmj.engine.flow import follow
from icmj.engine.open_loop import open_loop
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.engine.run import simulate
from icmj.engine.stepping import AIM, WITHIN, choose_step, make_schedule, round_step, step_for
from icmj.errors import SimulationError
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.ending import Outcome
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation, list_remarks

DISTURBED = [
    {"kind": "noise", "input": "torque", "size": 0.02, "bandwidth": 2.0, "seed": 1, "start": 0.2},
    {"kind": "impulse", "input": "torque", "size": 0.02, "start": 0.5003, "duration": 0.0371},
]


def leaning(actual: str, assumed: str, trigger: Trigger | None, delay: float, settings: Settings) -> Simulation:
    control = controller(assumed, 0.01)
    control = control if trigger is None else control.triggered_by(trigger)
    body = plant(actual, 0.9)
    x0 = np.zeros(body.linearisation.plant.n)
    x0[0] = 0.02
    return simulate(body, replace(control, delay=Delay(delay)), settings, x0=x0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["three_link", "pendulum"])
def test_no_interval_errs_by_more_than_is_asked_for_nor_its_peaks_by_ten_times_that(name: str) -> None:
    body, control, start = on_orbit(name)
    starts = [(k * start["x0"], k * start["x_o0"]) for k in (0.9, 1.1)]
    exact = [flight(body, control, *point) for point in starts]
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
        fly = open_loop(body, control, Settings(tolerance=tolerance))
        for point, true in zip(starts, exact, strict=True):
            flown = fly(*point)
            assert abs(flown.length - true.length) < tolerance * true.length
            size = np.maximum(np.abs(true.y_max), np.abs(true.y_min))
            peaks = np.maximum(np.abs(flown.y_max - true.y_max), np.abs(flown.y_min - true.y_min)) / size
            assert peaks.max() < 10 * tolerance


@pytest.mark.slow
@pytest.mark.parametrize("name", ["three_link", "pendulum"])
def test_the_error_stated_of_each_output_and_of_the_interval_is_true(name: str) -> None:
    body, control, start = on_orbit(name)
    x, a = start["x0"], np.concatenate([start["x_o0"], start["x_o0"]])
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
        settings = Settings(duration=8.0, tolerance=tolerance)
        loop = close_loop(body, control, settings)
        schedule = make_schedule(loop, settings)
        record = follow(loop, loop.data(x, a), schedule)
        stated, first = estimate(loop, schedule, record), loop.departures(record.events[-2:-1])
        begin, end = record.events[-2:, 0]
        true = flight(body, control, first.x[0], first.x_o[0])
        own = record.rows[(begin < record.rows[:, 0]) & (record.rows[:, 0] < end)]
        rows, states = loop.departures(own), course(body, control, first.x[0], first.x_o[0], own[:, 0] - begin)
        y = np.array([*map(equations(body, control).outputs, states), true.y])
        errors = np.abs(np.vstack([rows.y, loop.departures(record.events[-1:]).y]) - y).max(axis=0)
        # a factor of ten is asked for
        np.testing.assert_allclose(np.log10(stated.outputs / (errors / np.abs(y).max(axis=0))), 0, atol=0.3)
        np.testing.assert_allclose(np.log10(stated.interval / abs(end - begin - true.length)), 0, atol=0.3)


STIFF = {
    "hold of -22/s": ("pendulum", 1e-6, 1e-2),
    "observer of -40/s": ("pendulum", 0.1, 1e-7),
    "hold of -251/s": ("three_link", 5e-10, 2e-7),
    "observer of -564/s": ("three_link", 5e-7, 2e-11),
    "neither": ("pendulum", 1e-3, 1e-2),
}
"""A model, and weights R_c and R_o that make its loop stiff."""


@pytest.mark.slow
@pytest.mark.parametrize("which", STIFF)
def test_no_row_errs_by_more_than_ten_tolerances_and_what_is_stated_is_true(which: str) -> None:
    name, *weights = STIFF[which]
    body = plant(name, 0.9 if name == "three_link" else 1.2)
    gains = design_lq(plant(name).linearisation.plant, R_c=weights[0], R_o=weights[1])
    control = Controller(gains, system_matched(gains), EventTrigger(output_weight(gains), 0.01, 1e-3))
    n = body.linearisation.plant.n
    before = np.inf
    for tolerance in (1e-3, 1e-4, 1e-6, 1e-7, 1e-8, 1e-10):
        settings = Settings(duration=3.0, tolerance=tolerance, record_interval=1.0)
        step = choose_step(close_loop(body, control, settings), settings, tolerance)
        settings = replace(settings, record_interval=step)  # every step is a row
        run = simulate(body, control, settings, x0=np.repeat([0.02, 0.0], n // 2))
        begin, end = run.events.t[-2:]
        own = (begin < run.t) & (run.t < end)
        true = course(body, control, run.events.x[-2], run.events.x_o[-2], run.t[own] - begin)
        found = np.hstack([run.x, run.x_o, run.x_h])[own]
        error = float((np.abs(found - true).max(axis=0) / np.abs(true).max(axis=0)).max())
        assert error < min(WITHIN * tolerance, before)
        # halving the step tells what is of the fourth order, which is less sharp where an interval has few steps
        near = 0.25 if tolerance > 1e-5 else 0.1
        assert run.precision["state_error"] == pytest.approx(error, rel=near, abs=1e-12)
        before = error


@pytest.mark.slow
@pytest.mark.parametrize("name", ["three_link", "pendulum"])
def test_the_error_of_a_cycle_is_the_one_asked_for_within_a_factor_of_ten(name: str) -> None:
    """That of its intervals or, in a stiff loop, that of its rows, which is larger."""
    body, control, start = on_orbit(name)

    def flown(tolerance: float) -> Simulation:
        # rows so far apart that they do not bound the step
        return simulate(body, control, Settings(duration=20.0, tolerance=tolerance, record_interval=0.2), **start)

    exact = np.diff(flown(1e-13).events.t)[-5:]
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
        run = flown(tolerance)
        error = float(np.abs(np.diff(run.events.t)[-5:] - exact).max() / exact[-1])
        assert error < WITHIN * tolerance
        assert tolerance / 10 < max(error, float(run.precision["state_error"])) < WITHIN * tolerance


def on_orbit(name: str) -> tuple[MujocoPlant, Controller, dict[str, np.ndarray]]:
    body, control = plant(name, 0.9 if name == "three_link" else 1.2), controller(name, 0.01)
    return body, control, orbit_start(body, control, predicted(body, control))


@pytest.mark.slow
def test_the_stated_error_is_true_within_a_factor_of_ten() -> None:
    body, control = plant("three_link", 0.9), controller("three_link", 0.01)
    start = orbit_start(body, control, predicted(body, control))
    fine = simulate(body, control, Settings(duration=4.0, tolerance=1e-12), **start)
    for tolerance in (1e-6, 1e-8):
        run = simulate(body, control, Settings(duration=4.0, tolerance=tolerance), **start)
        exact = open_loop(body, control, Settings(duration=9.0, tolerance=1e-12))
        first = run.events
        again = exact(first.x[-2], first.x_o[-2])
        true = abs(again.length - (first.t[-1] - first.t[-2]))
        stated = float(run.precision["interval_error"])
        assert true / 10 < stated < 10 * true
        words = str(run.precision["output_errors"])
        assert [part.split()[0] for part in words.split(", ")] == ["shank", "thigh", "trunk"]
        errors = np.array([float(part.split()[1]) for part in words.split(", ")])
        # against a stretch flown at 1e-12: at the event itself the outputs differ by what its time does, too
        assert 0 < errors.max() < tolerance
        assert list_remarks(run) == ()
        with pytest.raises(SimulationError, match="tolerance"):
            choose_timestep(run, 1e-9)
    assert len(fine.events) == len(run.events)


def test_balls_turn_at_the_method_s_order(tmp_path: Path) -> None:
    body = load_plant(written(tmp_path, RICH), keyframe="up")
    random = np.random.default_rng(5)
    gains = design_lq(LinearPlant(*(random.normal(size=shape) for shape in ((3, 3), (3, 2), (3, 3)))))
    control = Controller(gains, system_matched(gains), Continuous())
    x, x_o = 0.3 * random.normal(size=10), 0.1 * random.normal(size=3)
    ends = {}
    for tolerance in (1e-4, 1e-7, 1e-10, 1e-12):
        run = simulate(body, control, Settings(duration=1.0, tolerance=tolerance, limit=100.0), x0=x, x_o0=x_o)
        assert run.outcome.kind == "completed"
        ends[tolerance] = run.x[-1]
        assert abs(np.linalg.norm(run.qpos[-1, 2:]) - 1) < 1e-14
    size = np.abs(ends[1e-12]).max()
    for tolerance in (1e-4, 1e-7, 1e-10):
        assert np.abs(ends[tolerance] - ends[1e-12]).max() < 20 * tolerance * size


def test_what_is_not_smooth_takes_the_engine_s_own_steps_with_a_word(tmp_path: Path) -> None:
    smooth = two_seconds(tmp_path, pendulum(MOTOR), Settings(duration=0.5))
    assert (smooth.precision["integrator"], smooth.precision["tolerance"]) == ("RK4", 1e-8)
    for text in (pendulum(MOTOR, joint='frictionloss="0.1"'), pendulum(MOTOR, joint='limited="true" range="-1 1"')):
        own = two_seconds(tmp_path, text, Settings(duration=0.5)).precision
        assert (own["integrator"], own["timestep"], own.get("tolerance")) == ("RK4", 0.002, None)
    rubbing = two_seconds(tmp_path, pendulum(MOTOR, joint='frictionloss="0.1"'), Settings(duration=0.5, tolerance=1e-6))
    assert (rubbing.precision["timestep"], rubbing.precision.get("tolerance")) == (0.002, None)
    assert [notice.kind for notice in list_remarks(rubbing)][:1] == ["not smooth"]
    # a limit that is far away is as good as none
    far = pendulum(MOTOR, joint='limited="true" range="-1 1"')
    near = two_seconds(tmp_path, far, Settings(duration=0.5, tolerance=1e-6))
    free = two_seconds(tmp_path, pendulum(MOTOR), Settings(duration=0.5, tolerance=1e-6))
    assert near.precision["tolerance"] == free.precision["tolerance"] == 1e-6
    np.testing.assert_allclose(near.x[-1], free.x[-1], atol=1e-12)


def two_seconds(folder: Path, text: str, settings: Settings) -> Simulation:
    body = load_plant(written(folder, text), keyframe="stand")
    gains = design_lq(body.linearisation.plant)
    control = Controller(gains, system_matched(gains), EventTrigger(np.eye(2), 0.02))
    return simulate(body, control, settings, x0=[0.01, 0.0], error_estimate=False)


def test_a_jump_that_nobody_announced_is_stepped_over(tmp_path: Path) -> None:
    text = pendulum(MOTOR, joint='limited="true" range="-0.02 0.02" solreflimit="0.0001 1"')
    run = two_seconds(tmp_path, text, Settings(duration=3.0, tolerance=1e-10, limit=5.0))
    assert isinstance(run.outcome, Outcome)
    assert run.outcome.kind == "completed"
    assert np.abs(run.x[:, 0]).max() < 0.03


def test_a_tolerance_is_instead_of_timestep_and_integrator() -> None:
    for wrong in ({"timestep": 1e-3}, {"integrator": "RK4"}):
        with pytest.raises(SimulationError, match="not both"):
            Settings(tolerance=1e-6, **wrong)  # type: ignore[arg-type]
    for wrong in (0.0, -1e-6, 1.0, float("nan")):
        with pytest.raises(SimulationError, match="tolerance"):
            Settings(tolerance=wrong)


def test_actions_edges_and_rows_are_met_to_the_last_bit() -> None:
    settings = settings_from({"duration": 2.5, "tolerance": 1e-6, "record_interval": 0.05, "disturbance": DISTURBED})
    run = leaning("pendulum", "pendulum", ClockTrigger(0.5), 0.2, settings)
    np.testing.assert_array_equal(run.events.t, 0.5 * np.arange(1, 6))
    assert run.t[-1] == 2.5
    free = leaning("pendulum", "pendulum", Continuous(), 0.0, replace(settings, disturbance=()))
    np.testing.assert_allclose(np.diff(free.t), 0.05, atol=1e-12)


def decay(rate: complex, step: float) -> float:
    """The largest error of y' = λy from 1 in steps of Runge and Kutta, of any instant while it dies out."""
    z = rate * step
    t = step * np.arange(1 + int(5 / (-rate.real * step)))
    return float(np.abs((1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24) ** np.arange(len(t)) - np.exp(rate * t)).max())


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("angle", [0.0, 0.5, 1.0, 1.3])
def test_what_dies_out_errs_by_three_tolerances_at_most(angle: float, tolerance: float) -> None:
    """And by not much less: the step is no shorter than that takes."""
    rate = -30 * np.exp(1j * angle)
    rates = np.array([rate, rate.conjugate()])
    step = step_for(np.append(rates, -0.1), np.zeros(0), tolerance)
    assert step <= 1 / 30
    assert 0.6 * AIM * tolerance < decay(rate, step) < 1.01 * AIM * tolerance
    # where nothing is slower
    assert 0.2 * AIM * tolerance < decay(rate, step_for(rates, np.zeros(0), tolerance)) < 0.41 * AIM * tolerance


def test_the_step_scales_with_time_and_with_the_fourth_root_of_the_tolerance() -> None:
    rates, omega = np.array([-8.0, -2.0 + 3.0j, -2.0 - 3.0j, 1.5, 0.0]), np.array([5.0])
    step = step_for(rates, omega, 1e-6)
    assert step_for(4 * rates, 4 * omega, 1e-6) == pytest.approx(step / 4, rel=1e-12)
    assert step_for(rates, omega, 1e-14) == pytest.approx(step / 100, rel=0.05)
    assert step_for(rates, np.array([500.0]), 1e-6) < step / 50
    assert step_for(np.zeros(2), np.zeros(0), 1e-6) == np.inf
    assert 0.8 / 8 < step_for(rates, omega, 0.1) < 1 / 8


def test_steps_are_rounded_down() -> None:
    assert round_step(0.1) <= 0.1 < 1.07 * round_step(0.1)
    assert round_step(round_step(0.1)) == round_step(0.1)
    assert round_step(np.inf) == np.inf


@pytest.mark.parametrize(("tolerance", "late"), [(1e-2, 0.0), (1e-7, 0.0), (1e-7, 0.0137)])
def test_rows_are_at_multiples_of_the_record_interval_and_change_nothing(tolerance: float, late: float) -> None:
    """Not a bit of events, extremes or what is at an instant that both runs have; after a threshold's sample, too."""
    body, control = plant("three_link", 0.9), replace(controller("three_link"), sampling_delay=late)
    runs = []
    for every in (0.6, 0.01, 0.0037, 1e-4):
        settings = Settings(duration=0.6, tolerance=tolerance, record_interval=every)
        run = simulate(body, control, settings, x0=0.02 * np.ones(6))
        assert len(run.events) > 0
        rows = run.t[~np.isin(run.t, run.events.t)]
        np.testing.assert_allclose(rows[:-1], every * np.arange(len(rows) - 1), rtol=1e-15)
        runs.append(run)
    for other in runs[1:]:
        assert other.precision["timestep"] == runs[0].precision["timestep"]
        for name in ("t", "x", "x_o", "y_max", "y_min"):
            np.testing.assert_array_equal(getattr(runs[0].events, name), getattr(other.events, name))
        np.testing.assert_array_equal(runs[0].x[-1], other.x[-1])
    known = simulate(body, control, Settings(duration=0.6, tolerance=1e-12, record_interval=1e-4), x0=0.02 * np.ones(6))
    size = np.abs(known.x).max(axis=0)
    assert (np.abs(runs[-1].x - known.x).max(axis=0) < WITHIN * tolerance * size).all()


@pytest.mark.parametrize("duration", [0.1, 0.0371])
def test_rows_of_one_step_find_room_or_the_step_is_shorter(duration: float) -> None:
    body, control = plant("pendulum", 0.9), controller("pendulum")
    settings = Settings(duration=duration, tolerance=0.01, record_interval=2e-5)
    run = simulate(body, control, settings, x0=[0.01, 0.0])
    np.testing.assert_allclose(run.t[:-1], 2e-5 * np.arange(len(run.t) - 1), rtol=1e-15)
