"""The linear plant: its checks, names, python-control round trip, T̂ and the family in ρ."""

from types import SimpleNamespace

import control
import numpy as np
import pytest
from scipy import signal

from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, deviate, transformation

PENDULUM = LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]], ("angle", "rate"), ("torque",), ("y",))


def test_the_pendulum_is_one_over_s_squared_minus_one_also_as_a_statespace_and_back():
    np.testing.assert_allclose(PENDULUM.poles, [1, -1], atol=1e-15)
    s = 0.3 + 2j
    assert PENDULUM.statespace()(s) == pytest.approx(1 / (s**2 - 1), rel=1e-14)
    back = LinearPlant.from_statespace(PENDULUM.statespace())
    for name in "ABC":
        np.testing.assert_array_equal(getattr(back, name), getattr(PENDULUM, name))
    assert (back.states, back.inputs, back.outputs) == (PENDULUM.states, PENDULUM.inputs, PENDULUM.outputs)


@pytest.mark.parametrize(("matrices", "word"), [
    (([[0, 1]], [[1]], [[1]]), "do not fit"),
    (([[0]], [[1], [2]], [[1]]), "do not fit"),
    (([[np.nan]], [[1]], [[1]]), "NaN"),
    (([[0]], [[1]], [[1]], ("a", "b")), "1 states but 2 names"),
])  # fmt: skip
def test_matrices_that_do_not_fit_are_refused(matrices, word):
    with pytest.raises(AnalysisError, match=word):
        LinearPlant(*matrices)


@pytest.mark.parametrize("kind", ["states", "inputs", "outputs"])
def test_a_name_stands_for_one_thing(kind):
    names = {"states": (), "inputs": (), "outputs": ()} | {kind: ("a", "a")}
    with pytest.raises(AnalysisError, match=f"{kind}: 'a' is named twice"):
        LinearPlant(-np.eye(2), np.eye(2), np.eye(2), **names)


@pytest.mark.parametrize("letter", "ABC")
def test_an_imaginary_part_is_not_dropped(letter):
    matrices = {"A": [[0, 1], [1, 0]], "B": [[0], [1]], "C": [[1, 0]]}
    one = {**matrices, letter: np.array(matrices[letter]) + 1j}
    for make in (lambda M: LinearPlant(**M), lambda M: LinearPlant.from_system(tuple(M.values()))):
        with pytest.raises(AnalysisError, match=f"{letter} is complex"):
            make(one)
    with pytest.raises(AnalysisError, match=f"{letter} is complex"):
        LinearPlant.from_system(SimpleNamespace(**one, D=0))
    real = LinearPlant(**{**matrices, letter: np.array(matrices[letter], dtype=complex)})
    np.testing.assert_array_equal(getattr(real, letter), matrices[letter])


def test_a_vector_will_do_for_a_single_input():
    plant = LinearPlant([[0, 1], [1, 0]], [0, 1], [1, 0])
    np.testing.assert_array_equal(plant.B, [[0], [1]])
    assert LinearPlant.from_system(([[0, 1], [1, 0]], [0, 1], [1, 0])).n_u == 1
    assert LinearPlant([[1]], [1, 2], [1]).n_u == 2  # of a single state they are two inputs


@pytest.mark.parametrize("system", [
    signal.TransferFunction([2, 1], [1, 0.5, -3]),
    signal.TransferFunction([2, 1], [1, 0.5, -3]).to_zpk(),
    signal.TransferFunction([2, 1], [1, 0.5, -3]).to_ss(),
    signal.lti([2, 1], [1, 0.5, -3]),
    control.tf([2, 1], [1, 0.5, -3]),
])  # fmt: skip
def test_systems_are_plants_in_all_their_forms(system):
    plant, s = LinearPlant.from_system(system), 0.3 + 2j
    assert plant.statespace()(s) == pytest.approx((2 * s + 1) / (s**2 + 0.5 * s - 3), rel=1e-12)


def test_a_descriptor_system_is_refused():
    matrices = {"A": [[0, 1], [1, 0]], "B": [[0], [1]], "C": [[1, 0]], "D": 0}
    with pytest.raises(AnalysisError, match="descriptor system"):
        LinearPlant.from_system(SimpleNamespace(**matrices, E=np.diag([1.0, 2.0])))
    assert LinearPlant.from_system(SimpleNamespace(**matrices, E=np.eye(2))).n == 2


def test_a_plant_does_not_change():
    with pytest.raises(ValueError, match="read-only"):
        PENDULUM.A[0, 0] = 1


def test_transformation_picks_states_by_name():
    longer = LinearPlant(np.eye(3), np.ones((3, 1)), np.ones((1, 3)), ("act", "rate", "angle"))
    np.testing.assert_array_equal(transformation(PENDULUM, longer), [[0, 0, 1], [0, 1, 0]])


def test_family_in_rho_joins_the_two_plants():
    actual = PENDULUM.scaled(0.8)
    np.testing.assert_array_equal(deviate(PENDULUM, actual, 0).B, PENDULUM.B)
    np.testing.assert_array_equal(deviate(PENDULUM, actual, 1).B, actual.B)
    np.testing.assert_allclose(deviate(PENDULUM, actual, 0.5).B, [[0], [0.9]])  # b = 1 − ρ (1 − 0.8)


def test_family_needs_the_same_states():
    other = LinearPlant(PENDULUM.A, PENDULUM.B, PENDULUM.C, ("a", "b"))
    with pytest.raises(AnalysisError, match="same states"):
        deviate(PENDULUM, other, 0.5)
    with pytest.raises(AnalysisError, match="same size"):
        deviate(PENDULUM, LinearPlant([[0]], [[1]], [[1]]), 0.5)


def test_matrices_and_systems_that_have_them_are_plants_and_a_plant_is_one():
    for system in (
        (PENDULUM.A, PENDULUM.B, PENDULUM.C),
        [PENDULUM.A, PENDULUM.B, PENDULUM.C, [[0]]],
        signal.StateSpace(PENDULUM.A, PENDULUM.B, PENDULUM.C, [[0]]),
        PENDULUM.statespace(),
        PENDULUM,
    ):
        plant = LinearPlant.from_system(system)
        for name in "ABC":
            np.testing.assert_array_equal(getattr(plant, name), getattr(PENDULUM, name))
    assert LinearPlant.from_system(PENDULUM) is PENDULUM


def falling(t, x, u, params):
    """A pendulum of unit length at any angle, against its torque and drag that grows with the square of its speed."""
    g = params.get("g", 9.81)
    return [x[1], g * np.sin(x[0]) - 0.3 * x[1] * abs(x[1]) + u[0] * np.cos(x[0])]


@pytest.mark.parametrize(("angle", "g"), [(0.0, 9.81), (0.3, 9.81), (-0.7, 1.62)])
def test_a_nonlinear_system_is_linearised_where_it_rests(angle, g):
    system = control.nlsys(falling, None, states=["angle", "rate"], inputs=["torque"], outputs=["angle", "rate"])
    u0 = -g * np.tan(angle)
    plant = LinearPlant.from_system(system, x0=[angle, 0], u0=[u0], params={"g": g})
    by_hand = g * np.cos(angle) - u0 * np.sin(angle)
    np.testing.assert_allclose(plant.A, [[0, 1], [by_hand, 0]], rtol=1e-8, atol=1e-5)  # the drag bends by 0.3 eps
    np.testing.assert_allclose(plant.B, [[0], [np.cos(angle)]], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(plant.C, np.eye(2), atol=1e-9)
    assert (plant.states, plant.inputs, plant.outputs) == (("angle", "rate"), ("torque",), ("angle", "rate"))


@pytest.mark.parametrize(("system", "more", "words"), [
    (control.ss([[0.5]], [[1]], [[1]], 0, 0.1), {}, "discrete"),
    (control.ss([[0.5]], [[1]], [[1]], [[2]]), {}, "feed-through"),
    (signal.TransferFunction([1], [1, -0.5], dt=0.1), {}, "discrete"),
    (signal.TransferFunction([1, 0], [1, 2]), {}, "feed-through"),
    (control.tf([1], [1, 1], 0.1), {}, "discrete"),
    (control.tf([1, 0], [1, 1]), {}, "feed-through"),
    (control.tf([[[1], [1]], [[1], [2]]], [[[1, 1], [1, 2]], [[1, 3], [1, 4]]]), {}, "as a StateSpace"),
    (control.frd([1, 2], [1, 2]), {}, "no plant can be made from a FrequencyResponseData"),
    (control.nlsys(falling, None, states=2, inputs=1, outputs=2), {"x0": [0.1, 0]}, "does not rest"),
    (control.nlsys(falling, None, states=2, inputs=1, outputs=2), {"x0": [0.1]}, "x0 has shape"),
    (control.nlsys(falling, None, states=2, inputs=1, outputs=2, dt=0.1), {}, "discrete"),
    (([[0]], [[1]], [[1]], [[1]]), {}, "feed-through"),
    (([[0]], [[1]]), {}, "2 matrices"),
    ("plant", {}, "no plant can be made from a str"),
])  # fmt: skip
def test_what_is_no_plant_is_told(system, more, words):
    make = LinearPlant.from_statespace if isinstance(system, control.StateSpace) else LinearPlant.from_system
    with pytest.raises(AnalysisError, match=words):
        make(system, **more)
