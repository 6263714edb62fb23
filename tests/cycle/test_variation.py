"""The equation of variation along a flight against differences of flights."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cycle_cases import case, return_map
from model_cases import RICH, written

from icmj import Controller, EventTrigger, LinearPlant, Settings, design_lq, load_plant, system_matched
from icmj.cycle.guess import guess_from_prediction
from icmj.cycle.jacobian import compute_jacobian, difference_jacobian, get_course, integrate_derivative
from icmj.cycle.return_map import ReturnMap
from icmj.errors import CycleError


@pytest.mark.parametrize(("name", "q_t", "plant"), [
    ("simple-0.8", 0.3, "mujoco"), ("three-link-0.9", 0.1, "mujoco"), ("neglected-0.1", 0.1, "mujoco"),
    ("three-link-1.1-delay", 0.03, "mujoco"), ("three-link-1.1-delay", 0.03, "linear"),
])  # fmt: skip
def test_it_is_what_differences_of_flights_say(name: str, q_t: float, plant: str) -> None:
    of = case(name, controller__q_t=q_t)
    loop = return_map(of, plant)
    guess = guess_from_prediction(of.theory, loop, q_t)
    expected = difference_jacobian(loop, guess.z, guess.scale).J
    found = integrate_derivative(loop, get_course(loop, guess.z, float(loop.turn(guess.z).intervals[0])), 1e-6)
    D = guess.scale[None, :] / guess.scale[:, None]
    assert np.abs((found - expected) * D).max() < 2e-6 * np.abs(expected * D).max()


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_with_the_hold_in_z_a_loop_without_delay_forgets_it(plant: str) -> None:
    """Another x_h before an event changes nothing after it, and what the next event finds has its derivative, too."""
    of = case("three-link-0.9", controller__q_t=0.1)
    short = return_map(of, plant)
    loop = replace(short, held=True)
    guess, plain = guess_from_prediction(of.theory, loop, 0.1), guess_from_prediction(of.theory, short, 0.1)
    m, N = of.controller.design.plant.n, short.size
    assert (loop.size, len(guess.z)) == (N + m, N + m)
    np.testing.assert_array_equal(loop.turn(guess.z).end[:N], short.turn(plain.z).end)
    other = guess.z + np.append(np.zeros(N), guess.scale[N:])
    np.testing.assert_array_equal(loop.turn(other).end, loop.turn(guess.z).end)
    found = integrate_derivative(loop, get_course(loop, guess.z, float(loop.turn(guess.z).intervals[0])), 1e-6)
    expected = difference_jacobian(loop, guess.z, guess.scale).J
    D = guess.scale[None, :] / guess.scale[:, None]
    assert np.abs((found - expected) * D).max() < 2e-6 * np.abs(expected * D).max()
    np.testing.assert_array_equal(found[:, N:], 0)
    assert np.abs(found[N:] * D[N:]).max() > 0.1


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_the_course_of_an_interval_is_what_a_simulation_records(plant: str) -> None:
    import icmj

    of = case("three-link-0.9-delay", controller__q_t=0.03)
    loop = return_map(of, plant)
    z = guess_from_prediction(of.theory, loop, 0.03).z
    along = get_course(loop, z, float(loop.turn(z).intervals[0]))
    run = icmj.simulate(of, plant, start=loop.split(z), duration=along.cuts[-1] - 1e-9)
    t = run.t[5:-1]
    t = t[np.abs(t - along.cuts[1]) > 1e-3]
    sample = along.sample(t)
    rows = np.searchsorted(run.t, t)
    for name in ("x", "x_o", "x_h", "y", "u"):
        expected = getattr(run, name)[rows]
        np.testing.assert_allclose(getattr(sample, name), expected, atol=1e-5 * np.abs(expected).max())


def test_where_joints_turn_freely_the_derivative_is_by_differences(tmp_path: Path) -> None:
    """A ball joint's position does not depart as its velocity does; from a start that is no cycle."""
    body = load_plant(written(tmp_path, RICH), keyframe="up")
    random = np.random.default_rng(5)
    gains = design_lq(LinearPlant(*(random.normal(size=shape) for shape in ((3, 3), (3, 2), (3, 3)))))
    control = Controller(gains, system_matched(gains), EventTrigger(np.eye(3), 0.05))
    loop = ReturnMap(body, control, Settings(duration=5.0, tolerance=1e-11, limit=100.0))
    z = np.concatenate([0.1 * random.normal(size=10), 0.1 * random.normal(size=3)])
    turn, scale = loop.turn(z), np.full(13, 0.1)
    with pytest.raises(CycleError, match="about one axis"):
        integrate_derivative(loop, get_course(loop, z, float(turn.intervals[0])))
    np.testing.assert_array_equal(compute_jacobian(loop, turn, scale), difference_jacobian(loop, z, scale).J)
