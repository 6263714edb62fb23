"""Activation dynamics before a linear plant, against closed forms of a lag and random plants."""

import numpy as np
import pytest
from scipy.linalg import expm

import icmj
from icmj.errors import AnalysisError, ModelError
from icmj.plant.activation import Activation
from icmj.plant.linear_plant import LinearPlant

INTEGRATOR = LinearPlant([[0.0]], [[1.0]], [[1.0]], ("x",), ("u",), input_units=("N m",))


def any_plant(seed: int) -> LinearPlant:
    rng = np.random.default_rng(seed)
    n, n_u, n_y = rng.integers(1, 6), rng.integers(1, 4), rng.integers(1, 4)
    return LinearPlant(rng.normal(size=(n, n)), rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))


def step_response(plant: LinearPlant, t: float) -> np.ndarray:
    """x(t) under u = 1 from rest: the exponential of the plant with its input as a state."""
    whole = np.zeros((plant.n + 1, plant.n + 1))
    whole[:-1, :-1], whole[:-1, -1] = plant.A, plant.B[:, 0]
    return np.asarray(expm(whole * t)[:-1, -1])


@pytest.mark.parametrize("t", [0.01, 0.1, 0.5, 2.0])
def test_the_step_response_is_that_of_a_lag(t):
    first = step_response(Activation(1, time_constant=0.17).before(INTEGRATOR), t)
    assert first[1] == pytest.approx(1 - np.exp(-t / 0.17), abs=1e-13)
    assert first[0] == pytest.approx(t - 0.17 * (1 - np.exp(-t / 0.17)), abs=1e-13)

    zeta, omega = 0.99, 16.8
    turn, sink = omega * np.sqrt(1 - zeta**2), np.exp(-zeta * omega * t)
    under = 1 - sink * (np.cos(turn * t) + zeta * omega / turn * np.sin(turn * t))
    second = step_response(Activation(2, frequency=omega, damping_ratio=zeta).before(INTEGRATOR), t)
    assert second[2] == pytest.approx(under, abs=1e-12)
    assert second[1] == pytest.approx(omega**2 / turn * sink * np.sin(turn * t), abs=1e-11)

    critical = step_response(Activation(2, time_constant=0.1).before(INTEGRATOR), t)
    assert critical[2] == pytest.approx(1 - np.exp(-10 * t) * (1 + 10 * t), abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_poles_and_transfer_function_are_the_plants_and_the_lags(seed):
    plant, rng = any_plant(seed), np.random.default_rng(100 + seed)
    tau, omega, zeta = rng.uniform(0.02, 0.3), rng.uniform(3.0, 30.0), rng.uniform(0.2, 2.0)
    s = complex(rng.normal(), rng.normal()) * 5
    below = [1.0, 2 * zeta * omega, omega**2]
    cases = (
        (Activation(1, tau), [-1 / tau], 1 / (tau * s + 1)),
        (Activation(2, frequency=omega, damping_ratio=zeta), np.roots(below), omega**2 / np.polyval(below, s)),
    )
    for activation, poles, lag in cases:
        behind = activation.before(plant)
        expected = np.poly(np.concatenate([np.linalg.eigvals(plant.A), *[poles] * plant.n_u]))
        assert np.poly(behind.A) == pytest.approx(expected, rel=1e-7, abs=1e-7 * np.abs(expected).max())
        bare, whole = (p.C @ np.linalg.solve(s * np.eye(p.n) - p.A, p.B) for p in (plant, behind))
        assert np.abs(whole - lag * bare).max() < 1e-10 * np.abs(whole).max()


def test_inputs_have_lags_by_name_and_pushes_go_past_them():
    push = icmj.plant.Push(body="trunk", force=(1.0, 0, 0))
    plant = LinearPlant(
        -np.eye(2), np.array([[1.0, 0.0], [0.0, 3.0]]), np.eye(2), ("p", "q"), ("ankle", "hip"),
        input_units=("N m", ""), B_d=np.diag([1.0, 2.0]), pushes={push: np.array([4.0, 5.0])},
    )  # fmt: skip
    behind = Activation(2, {"ankle": 0.1}, damping_ratio={"ankle": 0.7}).before(plant)
    assert behind.states == ("p", "q", "ankle_act0", "ankle_act1")
    assert behind.state_units[2:] == ("N m/s", "N m")
    assert behind.B.tolist() == [[0, 0], [0, 3], [pytest.approx(100), 0], [0, 0]]
    assert behind.A[:2, 2:].tolist() == [[0, 1], [0, 0]]
    assert behind.A[2:, 2:] == pytest.approx(np.array([[-14.0, -100.0], [1.0, 0.0]]))
    assert behind.B_d.tolist() == [[1, 0], [0, 2], [0, 0], [0, 0]]
    assert behind.effect(push).tolist() == [4, 5, 0, 0]
    assert Activation(1, 0.1).before(plant).state_units[2:] == ("N m", "")
    none = Activation(0).before(plant)
    assert none.states == plant.states
    assert np.array_equal(none.B, plant.B)


def test_a_limit_guards_no_activation():
    """A limit is of positions; where a plant names no rates it is of all states, but not of what its muscles do."""
    from icmj.linear.loop import find_positions

    assert find_positions(Activation(2, 0.1).before(any_plant(3))).tolist() == list(range(any_plant(3).n))


@pytest.mark.parametrize(("given", "words"), [
    ({"order": 3, "time_constant": 0.1}, "order must be 0, 1 or 2, got 3"),
    ({"order": True, "time_constant": 0.1}, "order must be"),
    ({"order": 1}, "give a lag of order 1 a time_constant"),
    ({"order": 1, "frequency": 3.0}, "a lag of order 1 has no frequency"),
    ({"order": 0, "time_constant": 3.0}, "a lag of order 0 has no time_constant"),
    ({"order": 1, "time_constant": np.nan}, "time_constant must be a positive number, got nan"),
    ({"order": 1, "time_constant": {"a": 0.0}}, "time_constant must be a positive number, got 0.0"),
    ({"order": 1, "time_constant": {}}, "time_constant names no input"),
    ({"order": 2, "time_constant": 0.1, "frequency": 3.0}, "either a time_constant"),
    ({"order": 2, "time_constant": 0.1, "damping_ratio": -1.0}, "damping_ratio must be a positive number"),
])  # fmt: skip
def test_what_is_no_lag_is_refused(given, words):
    with pytest.raises(ModelError, match=words):
        Activation(**given)


def test_names_that_the_plant_has_not_or_has_already_are_refused():
    with pytest.raises(ModelError, match="no input 'hip'; there are u"):
        Activation(1, {"hip": 0.1}).before(INTEGRATOR)
    with pytest.raises(ModelError, match="no input 'hip'"):
        Activation(2, 0.1, damping_ratio={"hip": 0.1}).before(INTEGRATOR)
    with pytest.raises(AnalysisError, match="'u_act' is named twice"):
        Activation(1, 0.1).before(Activation(1, 0.1).before(INTEGRATOR))
