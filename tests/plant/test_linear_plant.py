"""The linear plant: its checks, names, python-control round trip, T̂ and the family in ρ."""

import control
import numpy as np
import pytest

from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, transformation
from icmj.plant.matching import deviated

PENDULUM = LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]], ("angle", "rate"), ("torque",), ("y",))


def test_poles_of_the_pendulum_are_plus_and_minus_one():
    np.testing.assert_allclose(PENDULUM.poles, [1, -1], atol=1e-15)


def test_statespace_has_the_transfer_function_one_over_s_squared_minus_one():
    s = 0.3 + 2j
    assert PENDULUM.statespace()(s) == pytest.approx(1 / (s**2 - 1), rel=1e-14)


def test_statespace_round_trip_keeps_matrices_and_names():
    back = LinearPlant.from_statespace(PENDULUM.statespace())
    for name in "ABC":
        np.testing.assert_array_equal(getattr(back, name), getattr(PENDULUM, name))
    assert (back.states, back.inputs, back.outputs) == (PENDULUM.states, PENDULUM.inputs, PENDULUM.outputs)


@pytest.mark.parametrize(
    ("system", "word"),
    [
        (control.ss([[0.5]], [[1]], [[1]], 0, 0.1), "discrete"),
        (control.ss([[0.5]], [[1]], [[1]], [[2]]), "feed-through"),
    ],
)
def test_statespace_that_is_no_plant_is_refused(system, word):
    with pytest.raises(AnalysisError, match=word):
        LinearPlant.from_statespace(system)


@pytest.mark.parametrize(
    ("matrices", "word"),
    [
        (([[0, 1]], [[1]], [[1]]), "do not fit"),
        (([[0]], [[1], [2]], [[1]]), "do not fit"),
        (([[np.nan]], [[1]], [[1]]), "NaN"),
    ],
)
def test_matrices_that_do_not_fit_are_refused(matrices, word):
    with pytest.raises(AnalysisError, match=word):
        LinearPlant(*matrices)


def test_wrong_number_of_names_is_refused():
    with pytest.raises(AnalysisError, match="1 states but 2 names"):
        LinearPlant([[0]], [[1]], [[1]], ("a", "b"))


def test_a_plant_does_not_change():
    with pytest.raises(ValueError, match="read-only"):
        PENDULUM.A[0, 0] = 1


def test_transformation_picks_states_by_name():
    longer = LinearPlant(np.eye(3), np.ones((3, 1)), np.ones((1, 3)), ("act", "rate", "angle"))
    np.testing.assert_array_equal(transformation(PENDULUM, longer), [[0, 0, 1], [0, 1, 0]])


def test_family_in_rho_joins_the_two_plants():
    actual = PENDULUM.scaled(0.8)
    np.testing.assert_array_equal(deviated(PENDULUM, actual, 0).B, PENDULUM.B)
    np.testing.assert_array_equal(deviated(PENDULUM, actual, 1).B, actual.B)
    np.testing.assert_allclose(deviated(PENDULUM, actual, 0.5).B, [[0], [0.9]])  # b = 1 − ρ (1 − 0.8)


def test_family_needs_the_same_states():
    other = LinearPlant(PENDULUM.A, PENDULUM.B, PENDULUM.C, ("a", "b"))
    with pytest.raises(AnalysisError, match="same states"):
        deviated(PENDULUM, other, 0.5)
    with pytest.raises(AnalysisError, match="same size"):
        deviated(PENDULUM, LinearPlant([[0]], [[1]], [[1]]), 0.5)
