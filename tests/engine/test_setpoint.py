"""A set-point in MuJoCo: against the exact linear plant to second order in its size, and over steps."""

from dataclasses import replace

import engine_cases
import numpy as np
import pytest

from icmj import ClockTrigger, Continuous, Delay, Settings, Target, load_run, prepare, setpoint
from icmj.case.case import simulate as run_one
from icmj.controller.delay import NO_DELAY
from icmj.controller.setpoint import pulse, ramp, sines, step, ternary
from icmj.engine.run import simulate
from icmj.linear.run import simulate as simulate_linear

TIGHT = {"tolerance": 1e-11}


def following(model, size, trigger=None, t_d=0.0, steps_only=False, late=0.0):
    """A controller with a threshold in proportion to its set-point's size."""
    control = engine_cases.controller(model, q_t=0.2 * size, delta_min=0.1)
    plant = control.design.plant
    first, last = plant.outputs[0], plant.outputs[-1]
    moves = [Target({first: 1.0}, step(size, 0.5))]
    if not steps_only:
        moves += [
            Target({last: 1.0}, ramp(0.5 * size, 0.2, 1.0)),
            Target({last: 1.0}, pulse(-0.4 * size, 0.7, 0.45)),
            Target({first: 1.0}, sines([0.2 * size, 0.1 * size], [0.4, 1.3], [0.3, 1.0], 0.35)),
        ]
    return replace(
        control,
        trigger=trigger or control.trigger,
        delay=Delay(t_d) if t_d else NO_DELAY,
        setpoint=setpoint(plant, moves),
        sampling_delay=late,
    )


def apart(model, size, **more):
    """How far the plants are apart at events and the end, in units of the set-point; how late events are, how many."""
    control, plant = following(model, size, **more), engine_cases.plant(model)
    engine = simulate(plant, control, Settings(duration=2.0, **TIGHT), error_estimate=False)
    linear = simulate_linear(plant.linearisation.plant, control, Settings(duration=2.0))
    assert len(engine.events) == len(linear.events)
    ends = [np.vstack([run.events.x, run.x[-1:]]) @ plant.linearisation.plant.C.T for run in (engine, linear)]
    late = np.abs(engine.events.t - linear.events.t).max(initial=0.0)
    return np.abs(ends[0] - ends[1]).max() / size, late, len(engine.events)


@pytest.mark.parametrize("model", ["pendulum", "three_link"])
def test_a_step_departs_from_the_linear_plant_by_the_square_of_its_size(model) -> None:
    sizes = np.array([0.04, 0.02, 0.01]) / (1 if model == "pendulum" else 4)
    errors, late, events = zip(*(apart(model, size, steps_only=True) for size in sizes), strict=True)
    assert events[0] >= 1
    assert late[-1] == 0
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("model", ["pendulum", "three_link"])
@pytest.mark.parametrize(
    ("trigger", "t_d"),
    [(None, 0.0), (None, 0.15), (ClockTrigger(0.23), 0.0), (ClockTrigger(0.06), 0.15), (Continuous(), 0.0)],
)
def test_whatever_moves_it_departs_by_the_square_of_its_size(model, trigger, t_d) -> None:
    (large, *_), (small, _, events) = (apart(model, size, trigger=trigger, t_d=t_d) for size in (0.01, 0.005))
    assert events >= 3 or isinstance(trigger, Continuous)
    assert np.log2(large / small) == pytest.approx(2, abs=0.15)


@pytest.mark.parametrize("t_d", [0.0, 0.15])
def test_what_is_sampled_late_departs_by_the_square_of_its_size(t_d) -> None:
    (large, *_), (small, _, events) = (apart("pendulum", size, t_d=t_d, late=0.12) for size in (0.01, 0.005))
    assert events >= 3
    assert np.log2(large / small) == pytest.approx(2, abs=0.15)


def test_a_step_of_the_clock_s_own_time_is_taken_up_by_that_very_tick() -> None:
    control = following("pendulum", 0.01, trigger=ClockTrigger(0.25), steps_only=True)
    plant = engine_cases.plant("pendulum")
    for steps in (TIGHT, {"timestep": 0.004, "integrator": "RK4"}):
        run = simulate(plant, control, Settings(duration=1.0, record_interval=0.005, **steps), error_estimate=False)
        at = np.searchsorted(run.t, 0.5)
        assert (run.t[at], run.r[at, 0]) == (0.5, 0.01)
        np.testing.assert_allclose(run.u[: at + 1], 0, atol=1e-14)
        gain = control.setpoint.gain(control.design.k)[0, 0]
        assert run.u[at + 1, 0] == pytest.approx(0.01 * gain, rel=0.1)
        np.testing.assert_allclose(run.u_after(control)[1], 0.01 * gain, rtol=1e-12)


@pytest.mark.parametrize("t_d", [0.0, 0.15])
def test_a_timestep_is_of_fourth_order_with_it(t_d) -> None:
    control, plant = following("pendulum", 0.02, t_d=t_d), engine_cases.plant("pendulum")
    exact = simulate(plant, control, Settings(duration=2.0, tolerance=1e-12), error_estimate=False)
    errors = []
    for timestep in (0.016, 0.008, 0.004):
        settings = Settings(duration=2.0, timestep=timestep, integrator="RK4")
        run = simulate(plant, control, settings, error_estimate=False)
        errors.append(np.abs(run.events.t - exact.events.t).max())
        last = [run.x[-1], run.x_o[-1], run.x_h[-1]]
    np.testing.assert_allclose(last, [exact.x[-1], exact.x_o[-1], exact.x_h[-1]], rtol=0, atol=1e-8)
    assert np.polyfit(np.log([4, 2, 1]), np.log(errors), 1)[0] > 3.6


@pytest.mark.kernels
@pytest.mark.parametrize("way", ["linear", "timestep", "tolerance"])
@pytest.mark.parametrize("size", [1e-5, -1e-5])
def test_a_crossing_at_the_instant_of_a_step_is_judged_after_it(way, size, root) -> None:
    """The set-point moves within a picosecond of an event: which is first does not hang on the last bits."""
    given = load_run(root / "runs" / "rivals" / "one-link-event.toml")
    plain = {"assumed.delay": 0.0, "controller.delta_min": 0.05, "simulation.duration": 1.2}
    plain |= {"simulation.timestep": 0.005} if way == "timestep" else {}

    def play(start: float, size: float) -> np.ndarray:
        moves = [{"kind": "step", "output": "lean", "size": size, "start": start}]
        case = prepare(given.with_(**plain, setpoint=moves))
        return run_one(case, "linear" if way == "linear" else "mujoco").events.t

    event = float(play(1.1, 1e-6)[1])
    found = [play(event + off, size) for off in (-5e-13, -1e-13, 0.0, 1e-13, 5e-13)]
    for events in found:
        assert len(events) == len(found[0])
        assert events == pytest.approx(found[0], abs=1e-11)
    # later than that, the event is first; steps that end at the edge give it otherwise in the last digits
    assert play(event + 1e-10, size)[1] == pytest.approx(event, abs=1e-11)


@pytest.mark.parametrize("kind", ["nothing", "ternary", "step", "ramp", "sines"])
def test_what_never_moves_in_a_run_changes_nothing_but_is_there(kind: str) -> None:
    """A ternary sequence that begins at the end or after it has no term at all."""
    late = {
        "nothing": np.zeros((0, 5)), "ternary": ternary(0.01, 0.25, 3.0, 2.0), "step": step(0.01, 3.0),
        "ramp": ramp(0.01, 3.0, 1.0), "sines": sines([0.01], [0.4], [0.0], 3.0),
    }  # fmt: skip
    control, plant = engine_cases.controller("pendulum", q_t=0.01), engine_cases.plant("pendulum")
    settings = Settings(duration=2.0, initial={plant.linearisation.plant.states[0]: 0.02})
    target = Target({control.design.plant.outputs[0]: 1.0}, late[kind])
    held = replace(control, setpoint=setpoint(control.design.plant, [target]))
    with_it, without = (simulate(plant, each, settings) for each in (held, control))
    assert len(with_it.events) == len(without.events) >= 2
    np.testing.assert_allclose(with_it.events.t, without.events.t, rtol=1e-6)
    assert not with_it.r.any()
    assert with_it.r.shape == (len(with_it.t), 1)
