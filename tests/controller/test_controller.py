"""Holds, triggers and event weights: what is accepted and what is refused."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.linalg import expm

from icmj import Controller, Delay, Design, Hold, LinearPlant, design_lq, error_system, system_matched, zero_order
from icmj.controller.rules.quadratic import EventTrigger, as_weight
from icmj.controller.trigger import ClockTrigger
from icmj.errors import AnalysisError, DesignError

DESIGN = design_lq(LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]]), R_c=0.1, R_o=0.01)


def test_system_matched_hold_is_the_closed_loop_and_zero_order_stands_still():
    k_1, k_2 = DESIGN.k[0]
    np.testing.assert_allclose(system_matched(DESIGN).A_h, [[0, 1], [1 - k_1, -k_2]])
    np.testing.assert_array_equal(zero_order(DESIGN).A_h, np.zeros((2, 2)))


def test_a_free_hold_runs_by_the_matrix_exponential_with_or_without_distinct_modes():
    x_h, t = np.array([0.3, -0.2]), np.array([0.0, 0.1, 2.0])
    jordan = replace(zero_order(DESIGN), A_h=np.array([[-1.0, 1.0], [0.0, -1.0]]))
    for hold in (system_matched(DESIGN), zero_order(DESIGN), jordan):
        expected = [expm(hold.A_h * instant) @ x_h for instant in t]
        np.testing.assert_allclose(hold.free(x_h, t), expected, atol=1e-14)


@pytest.mark.parametrize(("weight", "expected"), [
    ("output", [[1, 0], [0, 0]]),
    ("identity", [[1, 0], [0, 1]]),
    ([2.0, 3.0], [[2, 0], [0, 3]]),
    ([[2.0, 1.0], [1.0, 3.0]], [[2, 1], [1, 3]]),
])  # fmt: skip
def test_event_weight_by_name_diagonal_or_matrix(weight, expected):
    np.testing.assert_array_equal(as_weight(weight, DESIGN), expected)


def test_event_weight_that_does_not_fit_is_refused():
    with pytest.raises(AnalysisError, match="2 states"):
        as_weight([1.0, 2.0, 3.0], DESIGN)
    with pytest.raises(AnalysisError, match="expected 'output'"):
        as_weight("states", DESIGN)


def test_a_clock_needs_a_positive_interval():
    with pytest.raises(AnalysisError, match="positive"):
        ClockTrigger(0.0)


def test_a_singular_event_weight_is_fine_and_is_made_symmetric():
    trigger = EventTrigger([[1, 1e-16], [0, 0]], 0.1)
    np.testing.assert_array_equal(trigger.Q_t, trigger.Q_t.T)


@pytest.mark.parametrize(("Q_t", "q_t", "delta_min", "word"), [
    ([[1, 0], [0, -1]], 0.1, 0.0, "semidefinite"), ([[1, 0]], 0.1, 0.0, "square"), (np.eye(2), 0.0, 0.0, "q_t"),
    (np.eye(2), np.nan, 0.0, "q_t"), (np.eye(2), 0.1, -1.0, "delta_min"),
])  # fmt: skip
def test_triggers_that_cannot_be_are_refused(Q_t, q_t, delta_min, word):
    with pytest.raises(AnalysisError, match=word):
        EventTrigger(Q_t, q_t, delta_min)


@pytest.mark.parametrize(("part", "words"), [
    ("trigger", "trigger is a float; expected a Trigger"), ("hold", "hold is a float; expected a Hold"),
    ("delay", "delay is a float; expected a Delay"), ("design", "design is a float; expected a Design"),
])  # fmt: skip
def test_each_part_is_of_its_kind(part, words):
    parts = {"design": DESIGN, "hold": system_matched(DESIGN), "trigger": ClockTrigger(0.3), "delay": Delay(0.0)}
    Controller(**parts)
    with pytest.raises(AnalysisError, match=words):
        Controller(**{**parts, part: 0.3})


@pytest.mark.parametrize("A_h", [np.zeros((3, 3)), [[0.0]]])
def test_a_hold_of_another_size_is_refused_where_it_is_given(A_h):
    hold = Hold("own", A_h)
    law = partial(Controller, DESIGN, hold, ClockTrigger(0.1))
    for use in (law, partial(error_system, DESIGN.plant, DESIGN, hold)):
        with pytest.raises(AnalysisError, match=r"A_h has shape \(\d, \d\); the controller's model has 2 states"):
            use()
    for wrong, words in (([[0, 1]], "square"), ([[1j]], "A_h is complex"), ([[1, 2], [3]], "A_h is not a matrix")):
        with pytest.raises(AnalysisError, match=words):
            Hold("own", wrong)


def test_complex_gains_and_weights_are_refused():
    for make in (
        lambda: Design(DESIGN.plant, DESIGN.k + 1j, DESIGN.L),
        lambda: Design(DESIGN.plant, DESIGN.k, DESIGN.L + 1j),
        lambda: design_lq(DESIGN.plant, R_c=1 + 1j),
        lambda: EventTrigger(np.eye(2) + 1j, 0.1),
        lambda: as_weight(np.ones(2) * 1j, DESIGN),
        lambda: error_system(DESIGN.plant, DESIGN, T_hat=np.eye(2) * 1j),
    ):
        with pytest.raises((AnalysisError, DesignError), match="is complex"):
            make()
