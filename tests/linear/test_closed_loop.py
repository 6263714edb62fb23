"""The closed loop's matrix in (x, d, e), against the paper's equations in (x, x_o, x_h)."""

from dataclasses import replace

import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, loop_matrix, pendulum_design, random_loop

from icmj.controller.trigger import Continuous
from icmj.errors import SimulationError
from icmj.linear.closed_loop import closed_loop
from icmj.plant.linear_plant import LinearPlant


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
    loop = closed_loop(plant, controller)
    x, x_o, x_h = (random.standard_normal(size) for size in (n, n_hat, n_hat))
    z = loop.state(x, x_o, x_h)
    assert np.allclose(np.concatenate([loop.x(z), loop.x_o(z), loop.x_h(z)]), np.concatenate([x, x_o, x_h]), atol=1e-14)
    rate = loop_matrix(plant, controller) @ np.concatenate([x, x_o, x_h])
    # the map to (x, d, e) is linear, so rates map as states do
    expected = loop.state(*np.split(rate, [n, n + n_hat]))
    assert np.abs(loop.M @ z - expected).max() < 1e-12 * np.abs(expected).max()


def test_an_exact_model_leaves_the_observer_error_alone():
    loop = closed_loop(PENDULUM, event_controller(pendulum_design()))
    assert not loop.M[2:4, :2].any()
    assert not loop.M[2:4, 4:].any()
    assert not loop.M[4:, :2].any()


def test_continuous_control_has_no_hold_error():
    controller = replace(event_controller(pendulum_design()), trigger=Continuous())
    assert not closed_loop(PENDULUM.scaled(0.8), controller).M[4:].any()


def test_plants_that_do_not_fit_are_refused():
    with pytest.raises(SimulationError, match="2 inputs"):
        closed_loop(LinearPlant(np.eye(2), np.eye(2), [[1, 0]]), event_controller(pendulum_design()))
