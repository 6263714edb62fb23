"""One open-loop interval as a function: on both plants it is what a run does from event to event."""

from dataclasses import replace

import numpy as np
import pytest
from engine_cases import controller, orbit_start, plant, predicted

from icmj import ClockTrigger, Continuous, Delay, Impulse, Settings, Step
from icmj.engine.open_loop import OpenLoops
from icmj.engine.open_loop import open_loop as engine_open_loop
from icmj.engine.run import simulate as simulate_engine
from icmj.linear.open_loop import open_loop as linear_open_loop
from icmj.linear.run import simulate as simulate_linear

SETTINGS = Settings(duration=6.0, timestep=2e-3)
PUSH = (Impulse("ankle_torque", 0.5, start=1.5003, duration=0.05), Step("hip_torque", 0.2, start=2.2))


@pytest.mark.parametrize("which", ["linear", "engine"])
@pytest.mark.parametrize("disturbed", [False, True])
@pytest.mark.parametrize("clock", [False, True])
def test_a_run_is_a_chain_of_intervals(which: str, disturbed: bool, clock: bool) -> None:
    body, control = plant("three_link", 0.9), controller("three_link")
    if clock:
        control = replace(control, trigger=ClockTrigger(0.4))
    settings = replace(SETTINGS, disturbance=PUSH if disturbed else (), duration=6.0, limit=3.0)
    x = 0.01 * np.ones(6)
    if which == "linear":
        linear = body.linearisation.plant
        run, fly = simulate_linear(linear, control, settings, x0=x), linear_open_loop(linear, control, settings)
    else:
        run, fly = simulate_engine(body, control, settings, x0=x), engine_open_loop(body, control, settings)
    assert len(run.events) >= 3
    x_o, t = np.zeros(6), 0.0
    for i in range(len(run.events)):
        flight = fly(x, x_o, t=t)
        assert flight.outcome is None
        assert flight.length == pytest.approx(run.events.interval[i], abs=2e-13)
        for name in ("x", "x_o", "x_h", "y_max", "y_min"):
            expected = getattr(run.events, name)[i]
            np.testing.assert_allclose(getattr(flight, name), expected, atol=3e-13 * (1 + np.abs(expected).max()))
        x, x_o, t = flight.x, flight.x_o, t + flight.length
    last = fly(x, x_o, t=t)
    assert last.outcome is not None
    assert last.outcome.kind == "completed"
    assert last.length == pytest.approx(settings.duration - t, abs=1e-12)
    np.testing.assert_allclose(last.x, run.x[-1], atol=1e-13)


def test_the_predicted_orbit_is_a_fixed_point_of_the_linear_interval() -> None:
    body, control = plant("three_link", 0.9), controller("three_link")
    prediction = predicted(body, control)
    start = orbit_start(body, control, prediction)
    flight = linear_open_loop(body.linearisation.plant, control, SETTINGS)(start["x0"], start["x_o0"])
    assert flight.length == pytest.approx(prediction.delta_crit, rel=1e-9)
    np.testing.assert_allclose(flight.x, start["x0"], atol=1e-9 * np.abs(start["x0"]).max())
    peak = np.maximum(np.abs(flight.y_max), np.abs(flight.y_min))
    np.testing.assert_allclose(peak, prediction.amplitude, rtol=1e-8)


@pytest.mark.parametrize("which", ["linear", "engine"])
def test_flights_that_do_not_end_in_an_event_say_how(which: str) -> None:
    body, control = plant("pendulum", 0.8), controller("pendulum").triggered_by(Continuous())
    settings = Settings(duration=1.0, limit=0.11)
    fly = (
        linear_open_loop(body.linearisation.plant, control, settings)
        if which == "linear"
        else engine_open_loop(body, control, settings)
    )
    fell = fly([0.1, 0.5], [0.0, 0.0])
    assert fell.outcome is not None
    assert fell.outcome.kind == "fell"
    assert 0 < fell.length < 1
    assert np.isnan(fell.y_max).all()
    calm = fly([0.01, 0.0], [0.01, 0.0])
    assert calm.outcome is not None
    assert calm.outcome.kind == "completed"
    assert calm.length == pytest.approx(1.0)


def test_flights_do_not_remember_one_another() -> None:
    fly = engine_open_loop(plant("three_link", 0.9), controller("three_link"), SETTINGS)
    first = fly(0.01 * np.ones(6), np.zeros(6))
    fly(0.02 * np.ones(6), np.zeros(6), t=1.0)
    again = fly(0.01 * np.ones(6), np.zeros(6))
    for name in ("length", "x", "x_o", "x_h", "y_max"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))


def test_loops_that_share_a_model_fly_as_each_alone_would_in_any_order() -> None:
    """Another gain, rule, delay or settings, and a body that is another model."""
    body, other, control = plant("three_link", 0.9), plant("pendulum", 0.9), controller("three_link")
    here = body.linearisation
    weaker = replace(body, linearisation=replace(here, ports=replace(here.ports, b=0.9 * here.ports.b)))
    settings = replace(SETTINGS, timestep=None, tolerance=1e-6)
    wanted = [
        (body, control, SETTINGS),
        (weaker, control, SETTINGS),
        (body, control.triggered_by(control.trigger.resized(0.02)), SETTINGS),
        (body, control, replace(settings, integrator=None)),
        (body, control, replace(SETTINGS, integrator="implicit")),
        (body, replace(control, delay=Delay(0.1)), SETTINGS),
        (other, controller("pendulum"), SETTINGS),
    ]
    x = {6: 0.01 * np.ones(6), 2: np.array([0.02, 0.0])}
    loops = OpenLoops()
    shared = [loops(*each) for each in wanted]
    alone = [engine_open_loop(*each) for each in wanted]
    assert [a.data is shared[0].data for a in shared] == [True] * 4 + [False] * 3
    for fly, own in [*zip(shared, alone, strict=True), *zip(shared[::-1], alone[::-1], strict=True)]:
        start = x[fly.loop.plant.linearisation.plant.n]
        a, b = (each(start, np.zeros(len(start)), 0.01 * np.ones(len(start))) for each in (fly, own))
        assert a.length == b.length
        np.testing.assert_array_equal(a.x, b.x)
        np.testing.assert_array_equal(a.y_max, b.y_max)


def test_what_a_flight_keeps_are_the_rows_of_a_run() -> None:
    body, control = plant("three_link", 0.9), controller("three_link")
    x = 0.01 * np.ones(6)
    for settings in (SETTINGS, Settings(duration=6.0, tolerance=1e-7)):
        flight, rows = engine_open_loop(body, control, settings, every=0.05).recorded(x, np.zeros(6))
        run = simulate_engine(body, control, replace(settings, record_interval=0.05), x0=x)
        n = len(rows)
        np.testing.assert_allclose(rows[:, 0], run.t[:n], atol=1e-13)
        np.testing.assert_allclose(rows[:, 1:4], run.qpos[:n], atol=1e-12)
        assert rows[-1, 0] == flight.length
        bare, end = engine_open_loop(body, control, settings).recorded(x, np.zeros(6))
        assert bare.length == flight.length
        assert len(end) == 2
