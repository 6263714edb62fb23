"""The equation of variation along a flight against differences of flights."""

from __future__ import annotations

import numpy as np
import pytest
from cycle_cases import case, return_map

from icmj.cycle.guess import from_prediction
from icmj.cycle.jacobian import jacobian
from icmj.cycle.variation import course, derivative


@pytest.mark.parametrize(
    ("name", "q_t", "plant"),
    [
        ("simple-0.8", 0.3, "mujoco"),
        ("three-link-0.9", 0.1, "mujoco"),
        ("neglected-0.1", 0.1, "mujoco"),
        ("three-link-1.1-delay", 0.03, "mujoco"),
        ("three-link-1.1-delay", 0.03, "linear"),
    ],
)
def test_it_is_what_differences_of_flights_say(name: str, q_t: float, plant: str) -> None:
    of = case(name, controller__q_t=q_t)
    loop = return_map(of, plant)
    guess = from_prediction(of, loop, q_t)
    expected = jacobian(loop, guess.z, guess.scale).J
    found = derivative(loop, course(loop, guess.z, float(loop.turn(guess.z).intervals[0])), 1e-6)
    D = guess.scale[None, :] / guess.scale[:, None]
    assert np.abs((found - expected) * D).max() < 2e-6 * np.abs(expected * D).max()


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_the_course_of_an_interval_is_what_a_simulation_records(plant: str) -> None:
    import icmj

    of = case("three-link-0.9-delay", controller__q_t=0.03)
    loop = return_map(of, plant)
    z = from_prediction(of, loop, 0.03).z
    along = course(loop, z, float(loop.turn(z).intervals[0]))
    run = icmj.simulate(of, plant, start=loop.split(z), duration=along.cuts[-1] - 1e-9)
    t = run.t[5:-1]
    t = t[np.abs(t - along.cuts[1]) > 1e-3]
    sample = along.sample(t)
    rows = np.searchsorted(run.t, t)
    for name in ("x", "x_o", "x_h", "y", "u"):
        expected = getattr(run, name)[rows]
        np.testing.assert_allclose(getattr(sample, name), expected, atol=1e-5 * np.abs(expected).max())
