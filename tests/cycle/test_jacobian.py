"""Differences of flights against the derivative in closed form, and what they say of their error."""

import numpy as np
import pytest
from cycle_cases import case, return_map

from icmj.cycle.guess import guess_from_prediction
from icmj.cycle.jacobian import compute_multipliers, difference_jacobian
from icmj.theory.event_maps import compute_jacobians


@pytest.mark.parametrize("name", ["simple-1.7", "neglected-0.1", "three-link-0.9"])
def test_on_the_linear_plant_they_are_right_to_1e_7_and_know_their_error(name: str) -> None:
    of = case(name)
    loop, system = return_map(of, "linear"), of.system
    guess = guess_from_prediction(of.theory, loop, of.theory.rule.size)
    found = difference_jacobian(loop, guess.z, guess.scale)
    n = system.n
    to_z = np.eye(n + system.n_hat)  # z = (x, x_o) from x̄ = (x, x_o − T̂x)
    to_z[n:, :n] = system.T_hat
    expected = to_z @ compute_jacobians(system, of.rule, of.prediction.orbit)[0] @ np.linalg.inv(to_z)
    D = guess.scale[None, :] / guess.scale[:, None]
    wrong = np.abs((found.J - expected) * D)
    assert wrong.max() < 1e-7 * np.abs(expected * D).max()
    assert (wrong <= found.error * D).all()
    values, errors = compute_multipliers(found, guess.scale)
    assert (np.abs(values - of.prediction.multipliers) <= errors).all()
    assert errors.max() < 1e-4


def test_threads_find_the_same() -> None:
    of = case("simple-0.8")
    loop = return_map(of)
    guess = guess_from_prediction(of.theory, loop, of.theory.rule.size)
    one, two = (difference_jacobian(loop, guess.z, guess.scale, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.J, two.J)
