"""Decisions between numbers that are equal but for rounding: the same, whatever the last bits are."""

from fractions import Fraction
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from icmj.base.array import (
    argmax_abs,
    argsort_descending,
    at_or_after,
    count_steps,
    find_range,
    is_between,
    list_multiples,
)
from icmj.base.balancing import balance, compute_exponential, propagate
from icmj.cycle.cycle import Cycle
from icmj.plant.linear_plant import LinearPlant
from icmj.theory.eigenstructure import compute_eigenstructure
from icmj.theory.event_maps import compute_multipliers
from icmj.theory.orbit import compute_critical_vectors

EPS = np.finfo(float).eps


def decimals(seed: int, count: int = 2000) -> list[Fraction]:
    """Decimal fractions from a millisecond to a minute, exactly."""
    random = np.random.default_rng(seed)
    return [Fraction(int(n), int(10 ** random.integers(1, 4))) for n in random.integers(1, 60_000, count)]


@pytest.mark.parametrize("seed", range(3))
def test_a_grid_has_the_points_that_exact_fractions_have(seed: int) -> None:
    random, naive = np.random.default_rng(seed), 0
    for step in decimals(seed):
        number = int(random.integers(1, 500))
        end, first = step * number, int(random.integers(0, number))
        assert count_steps(float(end) / float(step)) == number
        assert len(list_multiples(float(step), float(end), first)) == number - first + 1
        # one that does not come out even, by a thousandth of a step
        assert count_steps(float(end - step / 1000) / float(step)) == number - 1
        assert -count_steps(-float(end + step / 1000) / float(step)) == number + 1
        naive += int(float(end) / float(step)) != number
    assert naive > 0


@pytest.mark.parametrize("seed", range(3))
def test_a_band_holds_the_lines_that_exact_fractions_are_in(seed: int) -> None:
    random, naive = np.random.default_rng(seed), 0
    for spacing in decimals(seed, 300):
        low, high = sorted(spacing * int(k) for k in random.integers(0, 200, 2))
        lines = [k * spacing for k in range(200)]
        floats = np.fft.rfftfreq(400, float(1 / (400 * spacing)))[:200]  # of a rate that is measured
        expected = np.array([low <= line <= high for line in lines])
        np.testing.assert_array_equal(is_between(floats, float(low), float(high)), expected)
        naive += ((floats >= float(low)) & (floats <= float(high)) != expected).any()
    assert naive > 0


def test_an_instant_is_at_a_cut_whichever_way_it_was_worked_out_and_just_before_it_is_before() -> None:
    random, naive = np.random.default_rng(0), 0
    for step in decimals(0):
        number = int(random.integers(1, 500))
        cut, t = float(step * number), float(step) * number
        assert at_or_after(t, cut)
        assert at_or_after(cut, t)
        assert not at_or_after(cut * (1 - 1e-13), cut)
        naive += t < cut
    assert naive > 0
    assert not at_or_after(1e9, np.inf)


def test_equal_values_have_a_histogram() -> None:
    for size in (0.0, 1e-12, 0.3, -7.0, 1e9):
        values = size * (1 + EPS * np.array([0, 1, 0, -1, 2]))
        low, high = find_range(values)
        counts, edges = np.histogram(values, 100, (low, high))
        assert counts.sum() == 5
        assert (np.diff(edges) > 0).all()
        assert low < size < high
    assert find_range(np.array([1.0, 1.0 + 1e-6])) == (1.0, 1.0 + 1e-6)


def shaken(values: np.ndarray, seed: int) -> np.ndarray:
    """With other last bits."""
    return values * (1 + 8 * EPS * np.random.default_rng(seed).uniform(-1, 1, values.shape))


@pytest.mark.parametrize("seed", range(20))
def test_the_last_bit_decides_nothing(seed: int) -> None:
    assert argmax_abs(shaken(np.array([0.5, -1.0, 1.0, 1.0]), seed)) == 1
    keys, ties = np.array([2.0, 2.0, 3.0, 0.0, 2.0, -1.0]), np.array([1.0, 3.0, 0.0, 0.0, 2.0, 0.0])
    assert argsort_descending(shaken(keys, seed), ties).tolist() == [2, 1, 4, 0, 3, 5]


def test_what_differs_by_more_than_rounding_is_told_apart() -> None:
    assert argmax_abs(np.array([1.0, -1.0 - 1e-8])) == 1
    assert argsort_descending(np.array([1.0, 1.0 + 1e-8, 1e-9, 1e-8]), np.zeros(4)).tolist() == [1, 0, 3, 2]
    assert argsort_descending(np.zeros(0), np.zeros(0)).tolist() == []


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_states_go_on_for_times_of_their_own_as_closed_forms_say(unit: float) -> None:
    """A chain of integrators, an oscillator that decays and one mode that is fast, each state in its unit."""
    A = np.zeros((5, 5))
    A[0, 1], A[2:4, 2:4], A[4, 4] = 1.0, [[-0.3, 7.0], [-7.0, -0.3]], -400.0
    scale = np.array([1.0, unit, 1.0, 1.0, unit])
    t = np.array([0.0, 1e-9, 3e-4, 0.013, 0.5, 4.0, 21.7])
    x = np.random.default_rng(1).normal(size=(len(t), 5))
    turned = np.exp((-0.3 - 7.0j) * t) * (x[:, 2] + 1j * x[:, 3])
    expected = np.column_stack([x[:, 0] + t * x[:, 1], x[:, 1], turned.real, turned.imag, np.exp(-400.0 * t) * x[:, 4]])
    found = propagate(A * scale[:, None] / scale, x * scale, t) / scale
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
    still = propagate(np.zeros((2, 2)), x[:, :2], t)
    np.testing.assert_array_equal(still, x[:, :2])
    assert propagate(A, x[:0], t[:0]).shape == (0, 5)
    with np.errstate(all="raise"):  # a power that nothing needs is not a number any more
        np.testing.assert_allclose(propagate(np.eye(1), np.ones((1, 1)), np.array([700.0])), np.exp([[700.0]]))


@pytest.mark.parametrize("seed", range(20))
def test_the_sign_of_a_vector_whose_entries_are_equal_is_the_same(seed: int) -> None:
    """(1, −1)/√2 and (1, 1)/√2: two joints alike, as in a symmetric body."""
    for sign, v in ((1, [1.0, -1.0]), (-1, [1.0, 1.0])):
        other = np.array([v[1], -v[0]]) / np.sqrt(2)
        phi = shaken(sign * np.outer(v, v) / 2 + 0.3 * np.outer(other, other), seed)
        np.testing.assert_allclose(compute_critical_vectors(phi, sign)[:, 0], np.array(v) / np.sqrt(2), atol=1e-12)
        V_inv = compute_eigenstructure(phi, sign).V_inv
        assert V_inv is not None
        np.testing.assert_allclose(V_inv[0], np.array(v) / np.sqrt(2), atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_eigenvalues_of_one_size_come_in_one_order(seed: int) -> None:
    """m, −m and mi: their magnitudes are equal but for rounding."""
    random = np.random.default_rng(seed)
    blocks = np.zeros((5, 5))
    blocks[0, 0], blocks[1, 1], blocks[2:4, 2:4], blocks[4, 4] = 0.7, -0.7, [[0, 0.7], [-0.7, 0]], 0.2
    T = np.linalg.qr(random.standard_normal((5, 5)))[0]
    found = compute_multipliers(T @ blocks @ T.T)
    np.testing.assert_allclose(found, [0.7, 0.7j, -0.7j, -0.7, 0.2], atol=1e-12)
    plant = LinearPlant(T @ (blocks - 0.7 * np.eye(5)) @ T.T, T[:, :1], T[:1])
    np.testing.assert_allclose(plant.poles.real, np.sort(plant.poles.real)[::-1], atol=1e-12)


def cycle(multiplier: float) -> Any:
    """What of a cycle says whether it attracts."""
    values = np.array([multiplier, 0.5], complex)
    found = SimpleNamespace(
        multipliers=values, isolated=values, neutral=0, alternating=False, mixed=False, name="period-1 cycle",
        period=1.0, intervals=np.ones(1),
    )  # fmt: skip
    for name in ("attracting", "verdict"):
        setattr(found, name, cast(Any, getattr(Cycle, name)).fget(found))
    return found


def test_a_multiplier_on_the_circle_but_for_rounding_does_not_attract_and_says_so() -> None:
    words = cast(Any, Cycle.words).fget
    for error in (-1e-12, 0.0, 1e-12):
        assert not cycle(1 + error).attracting
        assert words(cycle(1 + error)) == (
            "A marginal period-1 cycle of 1 s, open-loop interval 1 s, largest multiplier 1, which is 1 up to "
            "rounding, so that attraction cannot be decided."
        )
    assert cycle(1 - 1e-6).attracting
    assert words(cycle(1 - 1e-6)).startswith("An attracting")
    assert words(cycle(1 + 1e-6)).startswith("A repelling")


def chained(unit: float, *, rates: bool = True) -> np.ndarray:
    """A loop of two states that drives a chain of three integrators, whose last is counted in another unit."""
    M = np.zeros((5, 5))
    M[:2, :2] = rates * np.array([[0.0, 2.0], [-3.0, -1.0]])
    M[2, 0], M[3, 2], M[4, 3] = 1.0, 1.0, 1.0
    units = np.array([1.0, 1.0, unit, 1.0, unit])
    return np.asarray(M * units / units[:, None])


@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1.0, 1e6, 1e12])
def test_units_of_a_chain_do_not_make_a_matrix_large(unit: float) -> None:
    M = chained(unit)
    balanced, scale = balance(M)
    np.testing.assert_array_equal(balanced * scale[:, None] / scale, M)  # powers of two
    assert np.linalg.norm(balanced, 2) < 4 * np.linalg.norm(M[:2, :2], 2)
    # without rates to compare with a chain is left as it is; its exponential is a sum of four terms
    alone = chained(unit, rates=False)
    expected = np.eye(5) + 3 * alone + 9 * alone @ alone / 2 + 27 * alone @ alone @ alone / 6
    np.testing.assert_allclose(compute_exponential(3 * alone), expected, rtol=1e-14)
