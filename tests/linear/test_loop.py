"""The closed loop's matrix in all coordinates, against the paper's equations in (x, x_o, x_h)."""

from dataclasses import replace

import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, loop_matrix, pendulum_design, random_loop

from icmj import ClockTrigger, Continuous, Delay, LinearPlant
from icmj.controller.closed_loop import CHAIN, ERRORS, ORIGINAL, compose
from icmj.errors import SimulationError
from icmj.linear.loop import make_linear_loop


@pytest.mark.parametrize("hold", ["system-matched", "zero-order"])
@pytest.mark.parametrize(("n", "n_hat", "n_u", "n_y"), [(2, 2, 1, 1), (4, 2, 1, 2), (3, 3, 2, 1), (2, 3, 1, 1)])
def test_rates_are_those_of_the_original_coordinates(hold, n, n_hat, n_u, n_y):
    random = np.random.default_rng(n + 10 * n_hat)
    if n >= n_hat:
        plant, design = random_loop(7, n, n_hat, n_u, n_y)
    else:
        _, design = random_loop(7, n_hat, n_hat, n_u, n_y)
        plant = LinearPlant(*(random.standard_normal(s) for s in ((n, n), (n, n_u), (n_y, n))))
    controller = event_controller(design, hold=hold)
    states = random.standard_normal(n + 2 * n_hat)
    d, e = random.standard_normal(n_u), random.standard_normal(n_y)
    rate = loop_matrix(plant, controller) @ states + np.concatenate([plant.B @ d, design.L @ e, np.zeros(n_hat)])
    T = random.standard_normal((n_hat, n))
    for origin in (ORIGINAL, ERRORS, CHAIN):
        for T_hat in (None, T):
            loop = compose(plant, controller, origin, T_hat)
            to = loop.coordinates
            w, back = to.of_states(states), to.on_w(np.eye(len(states)))
            assert np.abs(back @ w - states).max() < 1e-13
            # the map to w is linear, so rates map as states do
            expected = to.of_states(rate)
            assert np.abs(loop.F @ w + loop.D @ d + loop.E @ e - expected).max() < 1e-12 * np.abs(expected).max()
            assert np.abs(loop.K @ w - design.k @ states[n + n_hat :]).max() < 1e-12 * np.abs(design.k).max() * 10
            reset = np.concatenate([states[: n + n_hat], states[n : n + n_hat]])
            assert np.abs(back @ loop.J @ w - reset).max() < 1e-12


def test_views_of_the_moving_part():
    plant, design = random_loop(3, 4, 2, 1, 2)
    controller = replace(event_controller(design), trigger=ClockTrigger(0.02), delay=Delay(0.05))
    loop = make_linear_loop(plant, controller)
    random = np.random.default_rng(1)
    x, a = random.standard_normal(4), random.standard_normal(2 + 2 + 3 * 2)
    w = loop.state(x, a)
    assert (loop.moving, len(w)) == (8, 14)
    for found, given in ((loop.x(w[:8]), x), (loop.x_o(w[:8]), a[:2]), (loop.x_h(w[:8]), a[2:4]), (w[8:], a[4:])):
        np.testing.assert_allclose(found, given, atol=1e-14)
    assert not loop.composed.F[8:].any()
    assert not loop.composed.F[:, 8:].any()


def test_an_exact_model_leaves_the_observer_error_alone():
    M = make_linear_loop(PENDULUM, event_controller(pendulum_design())).M
    assert not M[2:4, :2].any()
    assert not M[2:4, 4:].any()
    assert not M[4:, :2].any()


def test_continuous_control_has_no_hold_error():
    controller = replace(event_controller(pendulum_design()), trigger=Continuous())
    assert not make_linear_loop(PENDULUM.scaled(0.8), controller).M[4:].any()


def test_plants_that_do_not_fit_are_refused():
    with pytest.raises(SimulationError, match="2 inputs"):
        make_linear_loop(LinearPlant(np.eye(2), np.eye(2), [[1, 0]]), event_controller(pendulum_design()))
