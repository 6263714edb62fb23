"""Modes and notices of plants whose structure is known."""

import numpy as np
import pytest

from icmj.errors import ModelError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.quality import Notice, Quality, Residual, neutral, permit, uncontrollable, unobservable

STATES = ("x", "tilt", "x_rate", "tilt_rate")


def cart(C, B=None):
    """A free cart that a falling pole pushes: x and its rate matter to nothing but themselves."""
    A = np.array([[0, 0, 1.0, 0], [0, 0, 0, 1.0], [0, -3.0, 0, 0], [0, 12.0, 0, 0]])
    return LinearPlant(A, [[0], [0], [1.0], [-2.0]] if B is None else B, C, STATES)


def test_a_place_that_no_output_shows_is_named():
    plant = cart([[0, 1.0, 0, 0]])
    assert {name for mode in unobservable(plant) for name in mode.states} == {"x"}
    assert all(mode.eigenvalue == 0 for mode in unobservable(plant))
    assert uncontrollable(plant) == ()
    assert {name for mode in neutral(plant) for name in mode.states} == {"x"}
    assert unobservable(cart(np.eye(2, 4))) == ()


def test_hidden_modes_are_found_in_any_coordinates_and_units():
    """Random plants with one mode that no input moves, in random coordinates: exactly one is found, at its place."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        n = rng.integers(3, 7)
        A, B, C = rng.normal(size=(n, n)), 1e-4 * rng.normal(size=(n, 1)), 1e3 * rng.normal(size=(2, n))
        A[0, 1:], B[0] = 0, 0
        T = rng.normal(size=(n, n))
        plant = LinearPlant(T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T))
        assert [mode.eigenvalue.real for mode in uncontrollable(plant)] == pytest.approx([A[0, 0]], abs=1e-3)
        assert unobservable(plant) == ()


def test_a_double_integrator_on_noise_is_still_neutral():
    A = np.array([[0, 1.0], [1e-9, 0]])
    assert neutral(LinearPlant(A, [[0], [1.0]], [[1.0, 0]], ("x", "x_rate")))[0].states[0] == "x"


def test_an_error_stops_unless_it_is_allowed():
    notices = Quality(Residual(1.0, "tilt", "rad/s²", 0.1)).notices
    with pytest.raises(
        ModelError, match=r'here: not at rest: tilt accelerates by 1 rad/s², 0.1 of gravity.*allow = \["no'
    ):
        permit(notices, (), "here")
    assert [notice.severity for notice in permit(notices, ("not at rest",), "here")] == ["warning"]
    same = Notice("keyframe", "warning", "twice")
    assert permit((same, same), (), "") == (same,)
    assert Quality(Residual(9e-6, "tilt", "rad/s²", 9e-7)).notices == ()
