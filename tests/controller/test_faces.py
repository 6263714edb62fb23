"""The event function: its value, rates, gradient and polynomials against each other's definitions and differences."""

import numpy as np
import pytest

from icmj import Design, LinearPlant
from icmj.controller.trigger import ClockTrigger, Continuous, EventTrigger, Faces
from icmj.errors import AnalysisError


def design(n: int) -> Design:
    plant = LinearPlant(np.zeros((n, n)), np.ones((n, 1)), np.eye(1, n))
    return Design(plant, np.zeros((1, n)), np.zeros((n, 1)))


def faces(seed: int) -> Faces:
    """Three faces of one, two and three rows."""
    random = np.random.default_rng(seed)
    return Faces(random.standard_normal((6, 4)), np.array([0, 1, 3, 6]), 0.3)


@pytest.mark.parametrize("rank", [1, 2, 4])
def test_the_paper_s_rule_is_one_face(rank: int) -> None:
    random = np.random.default_rng(rank)
    W = random.standard_normal((rank, 4))
    trigger = EventTrigger(W.T @ W, 0.02)
    found = trigger.faces(design(4))
    e = random.standard_normal((7, 4))
    assert len(found) == 1
    assert found.R.shape == (rank, 4)
    np.testing.assert_allclose(found.E(e), np.einsum("ij,jk,ik->i", e, W.T @ W, e) - 0.02**2, rtol=1e-12)
    np.testing.assert_allclose(found.gradient(e[0]), 2 * W.T @ W @ e[0], rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_e_is_the_highest_of_the_faces(seed: int) -> None:
    found, random = faces(seed), np.random.default_rng(seed)
    e = random.standard_normal((9, 4))
    by_hand = [[np.sum((found.R[a:b] @ x) ** 2) - 1 for a, b in ((0, 1), (1, 3), (3, 6))] for x in e]
    np.testing.assert_allclose(found.levels(e), by_hand, rtol=1e-12)
    np.testing.assert_allclose(found.E(e), 0.3 * np.max(by_hand, axis=1), rtol=1e-12)
    assert [found.active(x) for x in e] == list(np.argmax(by_hand, axis=1))


@pytest.mark.parametrize("seed", range(5))
def test_gradient_and_rates_are_differences(seed: int) -> None:
    found, random = faces(seed), np.random.default_rng(seed)
    e, rate, h = random.standard_normal(4), random.standard_normal(4), 1e-6
    gradient = [(found.E(e + h * d) - found.E(e - h * d)) / (2 * h) for d in np.eye(4)]
    np.testing.assert_allclose(found.gradient(e), gradient, rtol=1e-7, atol=1e-7)
    differences = (found.levels(e + h * rate) - found.levels(e - h * rate)) / (2 * h)
    np.testing.assert_allclose(found.rates(e, rate), differences, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_polynomials_are_exact_along_polynomial_motions(seed: int) -> None:
    found, random = faces(seed), np.random.default_rng(seed)
    motion = random.standard_normal((4, 2, 4))  # cubic, in two cells
    levels = found.polynomials(motion @ found.R.T)
    assert levels.shape == (7, 2, 3)
    for s in (0.0, 0.3, 1.0):
        e = sum(c * s**i for i, c in enumerate(motion))
        np.testing.assert_allclose(sum(c * s**i for i, c in enumerate(levels)), found.levels(e), rtol=1e-11, atol=1e-11)


def test_without_a_rule_there_is_no_event_function() -> None:
    for trigger in (ClockTrigger(0.2), Continuous()):
        none = trigger.faces(design(3))
        assert len(none) == 0
        assert np.isnan(none.E(np.ones((2, 3)))).all()
        assert none.levels(np.ones(3)).shape == (0,)


def test_a_rule_of_another_size_or_of_no_weight_is_refused() -> None:
    with pytest.raises(AnalysisError, match="the hold has 3 states"):
        EventTrigger(np.eye(2), 0.01).faces(design(3))
    with pytest.raises(AnalysisError, match="no hold error would ever be an event"):
        EventTrigger(np.zeros((2, 2)), 0.01)


def test_resizing_scales_the_threshold_alone() -> None:
    rule = EventTrigger(np.diag([1.0, 2.0]), 0.01, 0.3)
    larger = rule.resized(0.05)
    assert (rule.size, larger.size, larger.delta_min) == (0.01, 0.05, 0.3)
    e = np.array([0.2, -0.1])
    np.testing.assert_allclose(larger.faces(design(2)).levels(5 * e), rule.faces(design(2)).levels(e))
