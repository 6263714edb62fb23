"""The compiled simulation against the one piece by piece, and its roots and extremes against those in Python."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, neglected, pendulum_design, random_loop, settings

from icmj.base import bernstein
from icmj.controller.controller import Controller
from icmj.controller.delay import Delay
from icmj.controller.hold import system_matched, zero_order
from icmj.controller.trigger import BoxTrigger, ClockTrigger, Continuous
from icmj.linear.flight import stage
from icmj.linear.native.march import march
from icmj.linear.native.polynomial import DEEPEST, first_root, largest
from icmj.linear.open_loop import open_loop
from icmj.linear.passage import suits
from icmj.linear.run import simulate
from icmj.simulation.settings import Step

ROWS = ("t", "x", "y", "u", "x_o", "x_h", "E")
EVENTS = ("t", "x", "x_o", "x_h", "y_max", "y_min")


def both(plant, controller, run, **start):
    """The same run in both ways; they agree in everything that is recorded."""
    compiled = simulate(plant, controller, run, **start)
    pieces = simulate(plant, controller, replace(run, native=False), **start)
    assert suits(stage(plant, controller, run))
    assert compiled.outcome.kind == pieces.outcome.kind
    assert compiled.outcome.t == pytest.approx(pieces.outcome.t, abs=1e-12)
    assert len(compiled.events) == len(pieces.events)
    for of, names in (((compiled, pieces), ROWS), ((compiled.events, pieces.events), EVENTS)):
        for name in names:
            ours, theirs = (getattr(one, name) for one in of)
            assert ours.shape == theirs.shape, name
            scale = np.nanmax(np.abs(theirs), initial=0.0)
            if pieces.outcome.kind == "diverged":  # x_h is a small difference of numbers as large as the largest
                scale = max(scale, (1 + np.abs(controller.design.k).max()) * np.abs(pieces.x).max())
            assert np.array_equal(np.isnan(ours), np.isnan(theirs))
            assert np.nanmax(np.abs(ours - theirs), initial=0.0) <= 1e-11 * max(scale, 1e-300), name
    return compiled


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
    start = {"x0": 0.1 * random.standard_normal(n), "x_o0": 0.1 * random.standard_normal(n_hat)}
    interval = (0.01, 0.0037, 0.6)[seed % 3]
    run = both(plant, Controller(design, hold, rule, delay), settings(4.0, record_interval=interval), **start)
    assert len(run.events) > 2 or run.outcome.kind != "completed"


@pytest.mark.parametrize(
    "trigger",
    [ClockTrigger(0.3), ClockTrigger(0.1), ClockTrigger(0.04), Continuous()],
    ids=lambda trigger: trigger.kind,
)
@pytest.mark.parametrize("t_d", [0.0, 0.04])
def test_clocks_and_continuous_control(trigger, t_d):
    if t_d and not trigger.holds:
        pytest.skip("continuous control has no delay")
    design = pendulum_design()
    controller = Controller(design, system_matched(design), trigger, Delay(t_d))
    both(PENDULUM.scaled(0.9), controller, settings(3.0, record_interval=0.1, initial={"hinge": 0.02}))


def test_a_delayed_event_on_a_recording_instant_shifts_no_row():
    design = pendulum_design()
    rule = event_controller(design, q_t=0.01, delta_min=0.3).trigger
    controller = Controller(design, system_matched(design), rule, Delay(0.1234))
    run = both(PENDULUM.scaled(0.8), controller, settings(1.0, record_interval=0.01, initial={"hinge": 0.02}))
    assert run.events.t[0] == pytest.approx(30 * 0.01, abs=1e-12)  # a row of the grid, long before its action


@pytest.mark.parametrize(("limit", "kind"), [(0.3, "fell"), (1e15, "diverged")])
def test_runs_that_end_early(limit, kind):
    controller = event_controller(pendulum_design(), q_t=1e20 if kind == "diverged" else 0.01)
    run = both(PENDULUM.scaled(-1.0), controller, settings(60.0, initial={"hinge": 0.02}, limit=limit))
    assert run.outcome.kind == kind


def test_nothing_moves_and_nothing_is_due():
    run = both(PENDULUM, event_controller(pendulum_design()), settings(1.0))
    assert len(run.events) == 0


def test_sliding_on_the_least_interval():
    controller = event_controller(pendulum_design(), q_t=1e-9, delta_min=0.05)
    assert both(PENDULUM.scaled(0.5), controller, settings(4.0, initial={"hinge": 0.02})).outcome.kind == "sliding"


def test_more_events_and_rows_than_the_buffers_hold():
    controller = event_controller(pendulum_design(), q_t=1e-5, delta_min=0.003)
    run = both(PENDULUM.scaled(0.8), controller, settings(3.0, record_interval=2e-4, initial={"hinge": 0.02}))
    assert len(run.events) > 600
    assert len(run.t) > 10000


@pytest.mark.parametrize("t_d", [0.0, 0.05])
def test_one_interval(t_d):
    design, plant = pendulum_design(), neglected(0.3)
    controller = Controller(design, system_matched(design), event_controller(design).trigger, Delay(t_d))
    run = settings(9.0)
    fly, piecewise = (open_loop(plant, controller, replace(run, native=native)) for native in (True, False))
    random = np.random.default_rng(5)
    for t in (0.0, 0.7, 8.9, 9.0):
        x, x_o, x_h = random.standard_normal((3, 4)) * 0.02
        one, other = (way(x, x_o[:2], x_h[:2], t) for way in (fly, piecewise))
        assert (one.outcome is None) == (other.outcome is None)
        for name in ("length", "x", "x_o", "x_h", "y", "y_max", "y_min"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-11, atol=1e-14, err_msg=name)


def test_what_is_disturbed_goes_piece_by_piece():
    controller = event_controller(pendulum_design())
    pushed = settings(2.0, disturbance=(Step("torque", 0.1, 0.5),))
    assert not suits(stage(PENDULUM, controller, pushed))
    fast = Controller(controller.design, controller.hold, ClockTrigger(0.02), Delay(0.05))
    assert not suits(stage(PENDULUM, fast, settings(2.0)))


def test_roots_and_extremes_are_those_in_python():
    # what only compiled code calls has no door for Python
    root = numba.njit(lambda *arguments: first_root(*arguments))
    greatest = numba.njit(lambda *arguments: largest(*arguments))
    random = np.random.default_rng(2)
    stack, spans = np.empty((DEEPEST, 20)), np.empty((DEEPEST, 3))
    roots = 0
    for _ in range(300):
        degree = int(random.integers(1, 12))
        powers = random.standard_normal(degree + 1) * 2.0 ** -np.arange(degree + 1)
        F, until = bernstein.from_powers(degree), float(random.uniform(0.2, 1))
        expected, found = bernstein.first_root(powers), root(powers, degree, F, stack, spans)
        assert found == (2.0 if expected is None else pytest.approx(expected, abs=1e-13))
        roots += expected not in (None, 0.0)
        top = bernstein.largest(-powers, until)
        assert greatest(powers, degree, -1.0, until, -1e300, F, stack, spans) == pytest.approx(top, abs=1e-13)
    assert roots > 20


def test_what_is_kept_on_disk_is_found_by_the_next_process():
    # numba looks it up by the closure's contents; a compiled function among them is another in every process
    assert [type(cell.cell_contents) for cell in march().py_func.__closure__] == [int]
