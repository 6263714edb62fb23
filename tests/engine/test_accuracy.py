"""Error estimates by step doubling, and the timestep that follows from them."""

from dataclasses import replace

import numpy as np
import pytest
from engine_cases import controller, plant

from icmj import ClockTrigger, Continuous, Settings
from icmj.engine.accuracy import Accuracy, choose_timestep, estimate, order_of
from icmj.engine.closed_loop import ComposedLoop, close_loop
from icmj.engine.flow import Record, follow
from icmj.engine.run import simulate
from icmj.errors import SimulationError

X = 0.01 * np.ones(6)


def run(loop: ComposedLoop, timestep: float, duration: float = 4.0) -> tuple[Record, Accuracy]:
    schedule = loop.schedule(Settings(duration=duration), timestep)
    record = follow(loop, loop.data(X, np.zeros(12)), schedule)
    return record, estimate(loop, schedule, record)


@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
def test_estimate_is_the_error_of_an_interval(integrator: str) -> None:
    loop = close_loop(plant("three_link", 0.9), controller("three_link"), Settings(integrator=integrator))
    order = order_of(loop.model)
    assert order == (4 if integrator == "RK4" else 1)
    timestep = 8e-3 if order == 4 else 1e-3
    rows, found = run(loop, timestep)
    # the true error: the same interval, from the same state, at a far smaller step
    first, last = rows.events[-2], rows.events[-1]
    start = loop.departures(first[None, :])
    schedule = loop.schedule(Settings(duration=2.0), 2.5e-4 if order == 4 else 2e-5)
    fine = follow(loop, loop.data(start.x[0], np.tile(start.x_o[0], 2)), schedule)
    true = abs((last[0] - first[0]) - fine.events[0, 0])
    assert found.interval == pytest.approx(true, rel=0.25)
    assert found.stretch == pytest.approx(last[0] - first[0])


def test_timestep_chosen_from_an_estimate_meets_its_tolerance() -> None:
    body, control = plant("three_link", 0.9), controller("three_link")
    coarse = simulate(body, control, Settings(duration=4.0, timestep=8e-3), x0=X)
    for tolerance in (1e-7, 1e-9):
        h = choose_timestep(coarse, tolerance)
        facts = simulate(body, control, Settings(duration=4.0, timestep=h), x0=X).precision
        assert 0.1 * tolerance < float(facts["interval_error"]) / float(facts["error_stretch"]) < tolerance
    assert choose_timestep(coarse, 1.0) == pytest.approx(1 / float(coarse.precision["fastest_rate"]))
    short = simulate(body, control, Settings(duration=0.02, timestep=8e-3), x0=X)
    assert choose_timestep(short, 1e-9) == 8e-3
    with pytest.raises(SimulationError, match="run on the engine"):
        choose_timestep(replace(short, precision={"step": 0.1}), 1e-9)


def test_runs_without_events_are_estimated_by_their_outputs() -> None:
    # events and rows at multiples of both steps: the error is that of rows, which are then at the same instants
    for trigger in (Continuous(), ClockTrigger(0.288), ClockTrigger(2.88)):
        control = controller("three_link").triggered_by(trigger)
        errors = []
        for h in (8e-3, 4e-3):
            settings = Settings(duration=4.0, timestep=h, record_interval=0.024)
            precision = simulate(plant("three_link", 0.9), control, settings, x0=X).precision
            assert np.isnan(float(precision["interval_error"]))
            errors.append(float(precision["output_error"]))
        assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.7)


def test_an_interval_that_the_refractory_period_ends_has_no_error_of_its_own() -> None:
    # the same at any step, it would say 0 where only the outputs can tell
    trigger = replace(controller("three_link").trigger, delta_min=0.5, q_t=1e-9)
    run = simulate(
        plant("three_link", 0.9), controller("three_link").triggered_by(trigger), Settings(duration=4.0), x0=X
    )
    assert np.allclose(np.diff(run.events.t)[-3:], 0.5)
    assert np.isnan(float(run.precision["interval_error"]))
    assert 0 < float(run.precision["output_error"]) < 1e-6


def test_short_runs_are_not_estimated() -> None:
    run = simulate(plant("three_link", 0.9), controller("three_link"), Settings(duration=0.004), x0=X)
    assert np.isnan(float(run.precision["output_error"]))
    rest = simulate(plant("three_link", 0.9), controller("three_link"), Settings(duration=1.0))
    assert rest.precision["output_error"] == 0.0
    assert len(rest.events) == 0
