"""The methods that adapt steps: orders of their ends, their estimates and what they say between, and which is taken."""

from functools import cache
from typing import Any

import mujoco
import numba
import numpy as np
import pytest

from icmj.engine.native.adaptive import Stepper, densify, error_of, error_within, interpolate, stepper_of
from icmj.engine.schedule import METHODS, WITHIN, Tableau, method_for, round_step, tableau

SLIDE = """<mujoco><worldbody><body><joint type="slide"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


@cache
def compiled() -> tuple[Any, Any, Any]:
    """The state within a step, and the estimated errors at its end and within, as functions of their own."""

    @numba.njit
    def within(stepper, step, theta):  # type: ignore[no-untyped-def]
        densify(stepper, step)
        interpolate(stepper, theta)

    @numba.njit
    def error(stepper, step, tolerance):  # type: ignore[no-untyped-def]
        return error_of(stepper, step, tolerance)

    @numba.njit
    def dense(stepper, tolerance):  # type: ignore[no-untyped-def]
        return error_within(stepper, tolerance)

    return within, error, dense


def taken(table: Tableau, start: np.ndarray, K: np.ndarray, end: np.ndarray) -> Stepper:
    """A step of two states that has been taken, with its rates."""
    stepper = stepper_of(mujoco.MjModel.from_xml_string(SLIDE), np.zeros(1), table)
    stepper.start[:], stepper.end[:], stepper.K[: len(K)] = start, end, K
    return stepper


@pytest.mark.parametrize(("order", "between"), [(4, 3), (8, 7)])
def test_dense_output_meets_the_ends_and_converges_at_its_order(order: int, between: int) -> None:
    table = tableau(order)

    def errors(h: float) -> tuple[float, float]:
        """Errors of the step's end and of its middle for y' = (y₂, −y₁)."""
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
        K, start = np.zeros((table.rates, 2)), np.array([0.0, 1.0])
        end = start
        for stage in range(table.rates):
            y = start + h * (table.A[stage, :stage] @ K[:stage])
            K[stage] = turn @ y
            end = y if stage == table.stages else end
        stepper, within = taken(table, start, K, end), compiled()[0]
        within(stepper, h, 1.0)
        np.testing.assert_allclose(stepper.room, end, atol=1e-15)
        within(stepper, h, 0.4)
        middle = stepper.room.copy()
        powers = np.array([0.4**j for j in range(8)]) @ table.powers.T
        np.testing.assert_allclose(start + powers @ stepper.F, middle, atol=1e-15)
        return abs(end[0] - np.sin(h)), abs(middle[0] - np.sin(0.4 * h))

    # a step's error is of an order more than the method's
    coarse, fine = errors(0.4), errors(0.2)
    assert np.log2(coarse[0] / fine[0]) > order + 0.5
    assert np.log2(coarse[1] / fine[1]) > between + 0.5


@pytest.mark.parametrize("order", METHODS)
def test_the_coefficients_fulfil_the_conditions_of_their_order(order: int) -> None:
    """Those of the bushy trees, and of these grafted on one more edge (Hairer, Nørsett and Wanner, II.2)."""
    table = tableau(order)
    s = table.stages
    A, b, c = table.A[:s, :s], table.A[s, :s], table.c[:s]
    np.testing.assert_allclose(A.sum(axis=1), c, atol=1e-13)
    np.testing.assert_allclose([b @ c ** (k - 1) for k in range(1, order + 1)], 1 / np.arange(1, order + 1), atol=1e-13)
    grafted = [b @ A @ c ** (k - 2) for k in range(2, order + 1)]
    np.testing.assert_allclose(grafted, [1 / (k * (k - 1)) for k in range(2, order + 1)], atol=1e-13)
    assert abs(table.E5.sum()) < 1e-14
    assert abs(table.E5[: s + 1] @ table.c[: s + 1]) < 1e-14


@pytest.mark.parametrize("order", METHODS)
def test_the_estimated_error_is_of_the_method_s_order_and_not_below_the_true_one(order: int) -> None:
    """On y' = −y², whose solution from 1 is 1/(1 + t)."""
    table, errors, estimates = tableau(order), [], []
    tolerance = 1e-3
    for h in (0.1, 0.05):
        K = np.zeros((table.stages + 1, 1))
        for stage in range(table.stages + 1):
            y = 1 + h * (table.A[stage, :stage] @ K[:stage])
            K[stage] = -(y**2)
        errors.append(abs(float(y[0]) - 1 / (1 + h)))
        # two states alike, of which the error is told relative to the largest, 1, and in units of what is allowed
        stepper = taken(table, np.ones(2), np.tile(K, 2), np.tile(y, 2))
        estimates.append(compiled()[1](stepper, h, tolerance) * table.allowed * tolerance)
    assert order - 0.3 < np.log2(estimates[0] / estimates[1]) < order + 0.3
    assert errors[0] < estimates[0]


@pytest.mark.parametrize("order", METHODS)
def test_no_state_within_a_step_errs_by_more_than_is_estimated(order: int) -> None:
    """On y' = λy with every λ that does not grow, and steps up to beyond the bound of stability, from y = 1."""
    table, (within, at_end, inside) = tableau(order), compiled()
    tolerance = 1e-3
    for length in np.linspace(0.4, 6.5, 62):
        for angle in np.linspace(0, np.pi / 2, 11):
            rate = -length * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            K, start = np.zeros((table.rates, 2)), np.array([1.0, 0.0])
            end = start
            for stage in range(table.rates):
                y = start + table.A[stage, :stage] @ K[:stage]
                K[stage] = rate @ y
                end = y if stage == table.stages else end
            stepper, worst = taken(table, start, K, end), 0.0
            for theta in np.linspace(0, 1, 21):
                within(stepper, 1.0, theta)
                z = np.exp(-length * theta * np.exp(1j * angle))
                worst = max(worst, float(np.hypot(*(stepper.room - [z.real, z.imag]))))
            # states alike, of which errors are told relative to the largest, 1: of the end by their mean square
            stepper.start[:], stepper.end[:] = 1.0, 1.0
            estimates = (
                np.sqrt(2) * table.allowed * at_end(stepper, 1.0, tolerance),
                np.sqrt(2) * WITHIN * inside(stepper, tolerance),
            )
            assert worst < tolerance * (max(estimates) if order == 8 else 2 * estimates[0])


def test_the_low_order_is_for_stiff_loops_and_loose_tolerances() -> None:
    tolerances = 10.0 ** np.arange(-14, -1)
    assert {method_for(t, stiff=False).order for t in tolerances} == {8}
    orders = [method_for(t, stiff=True).order for t in tolerances]
    assert orders == sorted(orders, reverse=True)
    assert set(orders) == set(METHODS)
    assert method_for(1e-8, stiff=True).order == 8  # the default


def test_steps_are_rounded_down() -> None:
    assert round_step(0.1) <= 0.1 < 1.07 * round_step(0.1)
