"""Closure, trend and separation, on sequences whose answers are known."""

import numpy as np
import pytest

from icmj.measurement.measurement import closure, dominant_growth, separation, trend


def test_closure_of_a_geometric_sequence():
    states = 0.5 ** np.arange(8.0)[:, None] * [3.0, -1.0]
    assert closure(states, np.ones(8), 1, 1) == pytest.approx(np.full(7, 0.5))  # |s − 2s| / |2s|
    assert closure(states, np.ones(8), 2, 1) == pytest.approx(np.full(6, 0.75))
    assert closure(states, np.ones(8), 1, -1) == pytest.approx(np.full(7, 1.5))


def test_closure_sees_the_intervals_and_a_zero_state_has_not_closed():
    states = np.ones((4, 2))
    assert closure(states, np.array([1.0, 1.0, 2.0, 2.0]), 1, 1) == pytest.approx([0, 0.5, 0])
    assert np.isinf(closure(np.zeros((3, 2)), np.ones(3), 1, 1)).all()


def test_a_geometric_sequence_has_a_trend_and_noise_no_clear_one():
    fit = trend(4 * 0.7 ** np.arange(9.0))
    assert fit.ratio == pytest.approx(0.7)
    assert fit.clear
    assert not trend(np.random.default_rng(1).uniform(1, 2, 30)).clear
    assert not trend(np.array([1.0, 0.1])).clear


def test_what_outgrows_all_numbers_grows():
    with np.errstate(over="ignore"):
        fit = trend(np.float64(10.0) ** np.arange(200.0, 340.0, 20.0))  # the last one is infinite
    assert fit.ratio > 1e15
    assert fit.clear


@pytest.mark.parametrize("scale", [0.6, 1.0, 1.3])
def test_growth_of_a_spiral(scale):
    turn = scale * np.array([[np.cos(1.1), -2 * np.sin(1.1)], [0.5 * np.sin(1.1), np.cos(1.1)]])
    states = np.array([np.linalg.matrix_power(turn, i) @ [1.0, 0.5] for i in range(20)])
    assert dominant_growth(states) == pytest.approx(scale, rel=1e-12)


def test_rotation_keeps_neighbours():
    angle = 2 * np.pi * (np.sqrt(5) - 1) / 2 * np.arange(200)
    assert separation(np.column_stack([np.cos(angle), np.sin(angle)])) == pytest.approx(1, abs=0.01)


def test_the_logistic_map_parts_them():
    s = [0.3]
    for _ in range(400):
        s.append(4 * s[-1] * (1 - s[-1]))
    # its Lyapunov exponent is log 2; the distance saturates, so what is measured lies below
    assert 1.15 < separation(np.array(s)[:, None]) < 2.1


def test_of_very_many_states_the_last_are_compared():
    s = [0.3]
    for _ in range(200_000):  # all pairs would take 300 GB
        s.append(3.9 * s[-1] * (1 - s[-1]))
    states = np.array(s)[:, None]
    assert separation(states) == separation(states[-2000:])
    assert separation(states) > 1.15
