"""Modes and notices of plants whose structure is known."""

import ast
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

import icmj
from icmj.errors import ModelError, RunFileError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.quality import (
    Fault,
    Notice,
    Quality,
    Residual,
    dead,
    idle,
    neutral,
    permit,
    uncontrollable,
    unobservable,
)

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


def rank(M, N):
    """The rank of (N, M N, M² N, …), of whole numbers."""
    fmpz_mat = pytest.importorskip("flint", reason="exact ranks").fmpz_mat
    powers = [fmpz_mat(N.tolist())]
    for _ in M[1:]:
        powers.append(fmpz_mat(M.tolist()) * powers[-1])
    return fmpz_mat(np.hstack([np.array(power.tolist()) for power in powers]).tolist()).rank()


def in_units(plant, decades, rng):
    """The plant with states, inputs, outputs and time in other units, and the unit of time."""
    x, u, y = (10 ** rng.uniform(-decades, decades, size) for size in (plant.n, plant.n_u, plant.n_y))
    t = 10 ** rng.uniform(-decades, decades)
    A, B = plant.A * x / x[:, None] * t, plant.B * u / x[:, None] * t
    return LinearPlant(A, B, plant.C * x / y[:, None]), t


def verdicts(plant, t=1.0):
    """What is said of the modes of a plant, rates in the first unit of time."""
    modes = {find.__name__: find(plant) for find in (uncontrollable, unobservable, neutral)}
    said = {
        of: sorted((mode.states, mode.stable, np.round(mode.eigenvalue / t, 4) + 0) for mode in here)
        for of, here in modes.items()
    }
    return said, idle(plant), dead(plant)


@pytest.mark.parametrize("seed", range(40))
def test_hidden_modes_are_those_of_exact_ranks_in_any_units(seed):
    """Plants of small whole numbers and many zeros: Kalman's ranks are exact, and no unit changes what is said."""
    rng = np.random.default_rng(seed)
    n, n_u, n_y = rng.integers(1, 8), rng.integers(1, 3), rng.integers(1, 3)
    share = rng.uniform(0.1, 0.6)
    A, B, C = (
        np.where(rng.uniform(size=shape) < part, rng.integers(-3, 4, shape), 0)
        for shape, part in (((n, n), share), ((n, n_u), 0.4), ((n_y, n), 0.4))
    )
    plant = LinearPlant(A, B, C)
    assert bool(uncontrollable(plant)) == (rank(A, B) < n)
    assert bool(unobservable(plant)) == (rank(A.T, C.T) < n)
    assert any(mode.eigenvalue == 0 for mode in neutral(plant)) == (round(np.linalg.det(A)) == 0)
    for decades in (2, 3, 4):
        assert verdicts(*in_units(plant, decades, rng)) == verdicts(plant)


@pytest.mark.parametrize("seed", range(40))
def test_no_unit_changes_what_is_said_of_hidden_modes_in_mixed_coordinates(seed):
    rng = np.random.default_rng(seed)
    n, n_u, n_y = rng.integers(2, 9), rng.integers(1, 3), rng.integers(1, 3)
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n))
    A[0, 1:], B[0] = 0, 0  # no input moves the first
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    plant = LinearPlant(Q @ A @ Q.T, Q @ B, C @ Q.T)
    assert [mode.eigenvalue for mode in uncontrollable(plant)] == [pytest.approx(A[0, 0], abs=1e-9)]
    for decades in (2, 3, 4):
        assert verdicts(*in_units(plant, decades, rng)) == verdicts(plant)


def test_slow_modes_beside_a_neutral_one_are_not_taken_for_it():
    """A tank that nothing fills, one that empties within hours and one that overflows, beside a rate of 10/s."""
    plant = LinearPlant(np.diag([0.0, -1e-4, 1e-4, -10]), np.zeros((4, 1)), np.eye(4), ("a", "b", "c", "d"))
    found = {mode.states: (mode.eigenvalue, mode.stable) for mode in uncontrollable(plant)}
    assert found == {("a",): (0, False), ("b",): (-1e-4, True), ("c",): (1e-4, False), ("d",): (-10, True)}


def test_a_double_integrator_on_noise_is_still_neutral():
    A = np.array([[0, 1.0], [1e-9, 0]])
    differenced = LinearPlant(A, [[0], [1.0]], [[1.0, 0]], ("x", "x_rate"), error=1e-8)
    assert [mode.states for mode in neutral(differenced)] == [("x",)]
    assert idle(differenced) == ("x",)
    stated = replace(differenced, error=0.0)  # 1e-9/s² as it is stated: two rates of 3e-5/s
    assert (neutral(stated), idle(stated)) == ((), ())


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


def test_a_run_file_names_every_kind_of_error_and_a_warning_needs_no_entry(root):
    """By the syntax of all modules: of a notice, its kind and its severity."""
    called: dict[str, set[str]] = {"error": set(), "warning": set()}
    for path in (root / "icmj").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "Notice":
                kind, severity = (getattr(each, "value", None) for each in node.args[:2])
                called[severity].add(kind)
    assert called["error"] == {*get_args(Fault)}
    assert len(called["warning"]) > 15
    run = icmj.load_run("simple-0.8")
    allowed = [*get_args(Fault), "large step"]  # the latter stops none, and older files may have it
    assert run.with_(**{"analysis.allow": allowed}).analysis.allow == allowed
    with pytest.raises(RunFileError, match=r"allow\[0\]"):
        run.with_(**{"analysis.allow": [1]})
    for slip, meant in (("not at rset", "not at rest"), ("kinks", "kink"), ("Friction", "dry friction")):
        with pytest.raises(RunFileError, match=f"no notice is called '{slip}'; did you mean {meant}"):
            run.with_(**{"analysis.allow": [slip]})
