"""The compiled simulation against DOP853 restarted at every event, action and tick; and what no buffer may change."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, ivp_run, neglected, pendulum_design, random_loop, settings
from patience import PATIENCE

import icmj
from icmj import Bias, BoxTrigger, ClockTrigger, Controller, Delay, Impulse, Noise, Step, system_matched, zero_order
from icmj.linear.native.pieces import compile_pieces
from icmj.linear.open_loop import open_loop
from icmj.linear.run import simulate
from icmj.linear.simulator import Simulator
from icmj.simulation.disturbance import make_disturbance, make_reading_error

PUSHED = (
    Step("torque", 0.02, 0.31, on="command"),
    Impulse("torque", 0.01, 0.5, 0.2, on="command"),
    Noise(input="torque", size=0.03, bandwidth=6.0, seed=3, start=0.7),
    Noise(output="angle", size=1e-3, corner=0.8, seed=4, terms=60),
    Bias("angle", 1e-3, 1.1),
)


def agrees(plant, controller, run, x, x_o, close=1e-8, **more):
    """The same events, and the same state at the end, as of the independent integrator."""
    found = simulate(plant, controller, run, x0=x, x_o0=x_o)
    times, states, end = ivp_run(plant, controller, run.duration, x, x_o, **more)
    assert len(found.events) == len(times)
    np.testing.assert_allclose(found.events.t, times, atol=close, rtol=0)
    scale = max(np.abs(states).max(initial=0), np.abs(end).max())
    ours = np.hstack([found.events.x, found.events.x_o, found.events.x_h])
    np.testing.assert_allclose(ours, states, atol=10 * close * scale, rtol=0)
    last = np.concatenate([found.x[-1], found.x_o[-1], found.x_h[-1]])
    if not len(times) or times[-1] < run.duration:
        np.testing.assert_allclose(last, end, atol=10 * close * scale, rtol=0)
    return found


@pytest.mark.parametrize("seed", range(12))
def test_random_loops(seed):
    random = np.random.default_rng(seed)
    n_hat = int(random.integers(1, 5))
    n = n_hat + int(random.integers(0, 3))
    plant, design = random_loop(seed, n, n_hat, int(random.integers(1, 3)), int(random.integers(1, 3)))
    hold = (system_matched if seed % 3 else zero_order)(design)
    box = BoxTrigger(np.full(n_hat, 0.03), on="state", delta_min=0.02)
    rule = box if seed % 4 == 0 else event_controller(design, Q_t="identity", q_t=0.02, delta_min=0.013).trigger
    delay = Delay(0.037, 0.03) if seed % 2 else Delay()
    x, x_o = 0.1 * random.standard_normal(n), 0.1 * random.standard_normal(n_hat)
    run = agrees(plant, Controller(design, hold, rule, delay), settings(1.5), x, x_o)
    assert len(run.events) > 1


@pytest.mark.parametrize("clock", [0.3, 0.1, 0.04, 0.02, 0.0137])
@pytest.mark.parametrize("delay", [Delay(), Delay(0.04), Delay(0.05, 0.06), Delay(0.05, 0.035)])
def test_clocks_slower_and_faster_than_the_delay(clock, delay):
    design = pendulum_design()
    controller = Controller(design, system_matched(design), ClockTrigger(clock), delay)
    agrees(PENDULUM.scaled(0.9), controller, settings(0.91), [0.02, 0.0], [0.0, 0.0])


def disturbed(delay):
    """A run on which everything acts at once, within less than two seconds."""
    controller = replace(event_controller(pendulum_design(), q_t=0.004, delta_min=0.05), delay=Delay(delay))
    return simulate(PENDULUM.scaled(0.9), controller, settings(1.5, disturbance=PUSHED), x0=[0.02, 0.0])


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("delay", [0.0, 0.08])
def test_everything_that_can_disturb_at_once(delay):
    controller = replace(event_controller(pendulum_design(), q_t=0.004, delta_min=0.05), delay=Delay(delay))
    plant = PENDULUM.scaled(0.9)
    torque, reading = make_disturbance(PUSHED, plant.inputs), make_reading_error(PUSHED, plant.outputs)
    run = settings(2.0, disturbance=PUSHED, record_interval=0.003)
    # the integrator must not step over an edge without a word
    found = agrees(plant, controller, run, [0.02, 0.0], [0.0, 0.0], torque=torque, reading=reading, max_step=5e-4)
    assert len(found.events) > 4


def test_interpreted_it_is_the_same():
    """Python looks whether an index is within its array, and compiled code does not."""
    script = (
        "import sys; sys.path[:0] = ['tests', 'tests/linear']\n"
        "from test_simulator import disturbed\n"
        "print(*map(float.hex, disturbed(0.08).events.t))"
    )
    told = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True, timeout=PATIENCE,
        env={**os.environ, "ICMJ_INTERPRETED": "1"}, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    times = disturbed(0.08).events.t
    assert len(times) > 3
    assert [float.fromhex(word) for word in told.stdout.split()] == pytest.approx(times, abs=1e-11)


@pytest.mark.parametrize("noisy", [False, True])
def test_rows_and_buffers_change_no_bit_of_the_motion(noisy):
    controller = event_controller(pendulum_design(), q_t=1e-3, delta_min=0.003)
    plant, run = PENDULUM.scaled(0.8), settings(9.0, disturbance=PUSHED if noisy else ())
    runs = [
        simulate(plant, controller, replace(run, record_interval=interval), x0=[0.02, 0], progress=progress)
        for interval in (2e-4, 0.0137, 9.0)
        for progress in (None, lambda share: None)
    ]
    assert len(runs[0].t) > 20000
    assert len(runs[0].events) > 30
    for other in runs[1:]:
        for name in ("t", "x", "x_o", "x_h", "y_max", "y_min"):
            np.testing.assert_array_equal(getattr(other.events, name), getattr(runs[0].events, name))


def test_rows_are_what_the_integrator_has_there():
    controller, plant = event_controller(pendulum_design()), PENDULUM.scaled(0.9)
    torque, reading = make_disturbance(PUSHED, plant.inputs), make_reading_error(PUSHED, plant.outputs)
    for disturbance, acting in (((), {}), (PUSHED, {"torque": torque, "reading": reading, "max_step": 5e-4})):
        run = simulate(plant, controller, settings(0.9, disturbance=disturbance, record_interval=0.0123), x0=[0.02, 0])
        for index in (5, 30, 60):
            end = ivp_run(plant, controller, run.t[index], [0.02, 0], [0, 0], **acting)[2]
            row = np.concatenate([run.x[index], run.x_o[index], run.x_h[index]])
            np.testing.assert_allclose(row, end, atol=1e-9, rtol=0)


def test_a_delayed_event_on_a_recording_instant_shifts_no_row():
    design = pendulum_design()
    rule = event_controller(design, q_t=0.01, delta_min=0.3).trigger
    controller = Controller(design, system_matched(design), rule, Delay(0.1234))
    run = simulate(PENDULUM.scaled(0.8), controller, settings(1.0, record_interval=0.01, initial={"hinge": 0.02}))
    assert run.events.t[0] == pytest.approx(30 * 0.01, abs=1e-12)  # a row of the grid, long before its action
    # events and actions have rows of their own between those of the grid
    grid = 0.01 * np.arange(101)
    own = np.concatenate([run.events.t, run.events.t + 0.1234, [0.1234]])  # a run begins with an event
    near = np.abs(run.t[:, None] - np.concatenate([grid, own])).min(axis=1)
    assert near.max() < 1e-12
    np.testing.assert_allclose(run.t[np.abs(run.t[:, None] - grid).min(axis=1) < 1e-12], grid, atol=1e-12)


@pytest.mark.parametrize(("limit", "kind"), [(0.3, "fell"), (1e15, "diverged")])
def test_runs_that_end_early(limit, kind):
    controller = event_controller(pendulum_design(), q_t=1e20 if kind == "diverged" else 0.01)
    run = simulate(PENDULUM.scaled(-1.0), controller, settings(60.0, initial={"hinge": 0.02}, limit=limit))
    assert run.outcome.kind == kind
    assert kind == "diverged" or abs(run.x[-1, 0]) == pytest.approx(limit, rel=1e-12)


def test_nothing_moves_and_nothing_is_due():
    assert len(simulate(PENDULUM, event_controller(pendulum_design()), settings(1.0)).events) == 0


def test_sliding_on_the_least_interval():
    controller = event_controller(pendulum_design(), q_t=1e-9, delta_min=0.05)
    run = simulate(PENDULUM.scaled(0.5), controller, settings(4.0, initial={"hinge": 0.02}))
    assert run.outcome.kind == "sliding"


@pytest.mark.parametrize("t_d", [0.0, 0.05])
def test_one_interval_is_the_first_of_a_run(t_d):
    design, plant = pendulum_design(), neglected(0.3)
    controller = Controller(design, system_matched(design), event_controller(design).trigger, Delay(t_d))
    fly = open_loop(plant, controller, settings(9.0))
    random = np.random.default_rng(5)
    for _ in range(4):
        x, x_o, x_h = random.standard_normal((3, 4)) * 0.02
        flight = fly(x, x_o[:2], x_h[:2])
        run = simulate(plant, controller, settings(9.0), x0=x, x_o0=x_o[:2], x_h0=x_h[:2])
        assert flight.length == pytest.approx(run.events.t[0], abs=1e-12)
        np.testing.assert_allclose(flight.x, run.events.x[0], atol=1e-14)
        later = fly(x, x_o[:2], x_h[:2], 0.7)  # the plant does not know what time it is
        assert later.length == pytest.approx(flight.length, abs=1e-12)
    assert fly(x, x_o[:2], x_h[:2], 9.0).outcome is not None


def test_a_prepared_simulator_runs_again_as_it_ran_before():
    controller, plant = event_controller(pendulum_design()), PENDULUM.scaled(0.9)
    prepared = Simulator(plant, controller, settings(3.0, disturbance=PUSHED), 0.01)
    w = prepared.loop.state(np.array([0.02, 0.0]), np.zeros(4))
    first, second = prepared.run(w)[0], prepared.run(w)[0]
    np.testing.assert_array_equal(first.Z, second.Z)


def test_what_is_kept_on_disk_is_found_by_the_next_process():
    # numba looks it up by the closure's contents; a compiled function among them is another in every process
    assert [type(cell.cell_contents) for cell in compile_pieces().py_func.__closure__] == [int]


@pytest.mark.parametrize("interval", [0.001, 0.005, 0.02, 0.3])
def test_rows_are_the_same_whether_their_grid_fits_the_steps_or_not(interval):
    controller, plant = event_controller(pendulum_design()), PENDULUM.scaled(0.9)
    both = [
        simulate(plant, controller, settings(3.0, disturbance=PUSHED, record_interval=each), x0=[0.02, 0])
        for each in (interval, interval / 7.3)
    ]
    shared = [np.round(run.t / interval * 10) / 10 for run in both]
    _, ours, theirs = np.intersect1d(*shared, return_indices=True)
    close = np.abs(both[0].t[ours] - both[1].t[theirs]) < 1e-13
    assert close.sum() >= 2
    np.testing.assert_allclose(both[0].x[ours][close], both[1].x[theirs][close], atol=1e-14, rtol=0)


def _pushed(delay, acting, duration=12.0, **changes):
    """The one-link person whose rule is watched again where the last event acts, pushed."""
    changes = {"assumed.delay": delay, "controller.delta_min": 0.001, "simulation.duration": duration, **changes}
    return icmj.prepare(
        icmj.load_run("runs/rivals/one-link-event.toml").with_(**changes, **{"simulation.disturbance": acting})
    )


@pytest.mark.parametrize("delay", [0.06, 0.09, 0.13, 0.2])
def test_what_begins_later_leaves_the_past_as_it_was(delay):
    push = {"kind": "step", "input": "ankle_torque", "size": 0.5, "start": 1.0}
    whisper = {"kind": "step", "input": "ankle_torque", "size": 1e-9, "start": 11.0}
    for acting in ([], [push]):
        quiet, later = (icmj.simulate(_pushed(delay, found), "linear") for found in (acting, [*acting, whisper]))
        before = quiet.t < 11.0
        # rounding, times what an unstable body makes of it in 11 s
        np.testing.assert_allclose(later.x[: before.sum()], quiet.x[before], rtol=0, atol=1e-8)


@pytest.mark.parametrize("delay", [0.06, 0.09, 0.13, 0.2])
def test_every_event_acts_though_the_next_is_due_at_that_instant(delay):
    case = _pushed(delay, [{"kind": "step", "input": "ankle_torque", "size": 0.5, "start": 1.0}])
    linear, engine = icmj.simulate(case, "linear"), icmj.simulate(case, "mujoco")
    assert linear.outcome.kind == engine.outcome.kind
    # an action sets the hold to what the observer has predicted: it jumps at each of them
    acts = linear.events.t + delay
    for t in acts[acts < 11.9]:
        at = np.searchsorted(linear.t, t)
        jump = np.abs(linear.x_h[at + 1] - linear.x_h[at - 1]).max()
        assert jump > 1e-6, t
    # the body is bent by 1e-4 of its sway more than the linear one; without an action it would fall
    np.testing.assert_allclose(np.abs(linear.x).max(), np.abs(engine.x).max(), rtol=5e-3)


def test_an_event_due_where_the_run_ends_belongs_to_it():
    push = [{"kind": "step", "input": "ankle_torque", "size": 0.5, "start": 0.0}]
    longer = icmj.simulate(_pushed(0.1, push, 3.0, **{"controller.q_t": 2e-4}), "linear").events.t
    sliding = longer[np.flatnonzero(np.diff(longer, prepend=0) == longer[1] - longer[0])]
    end = float(sliding[len(sliding) // 2])
    for plant in ("linear", "mujoco"):
        events = icmj.simulate(_pushed(0.1, push, end, **{"controller.q_t": 2e-4}), plant).events.t
        assert events[-1] == end
