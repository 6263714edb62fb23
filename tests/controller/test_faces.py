"""The event function: its value, rates, gradient and polynomials against each other's definitions and differences."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from icmj import Design, LinearPlant, design_lq, load_run, prepare, simulate
from icmj.controller.rules.quadratic import EventTrigger
from icmj.controller.trigger import ClockTrigger, Continuous, Faces
from icmj.errors import AnalysisError, DesignError


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


def exactly(Q: np.ndarray, e: np.ndarray) -> Fraction:
    """eᵀQe of these very numbers."""
    rows = [[Fraction(q) for q in row] for row in Q.tolist()]
    at = [Fraction(x) for x in e.tolist()]
    return sum((a * q * b for a, row in zip(at, rows, strict=True) for q, b in zip(row, at, strict=True)), Fraction(0))


@pytest.mark.parametrize(
    ("spread", "draws"), [(0, 60), (2, 60), (4, 60), (8, 60), pytest.param(8, 1000, marks=pytest.mark.slow)]
)
def test_units_of_the_states_do_not_matter_to_a_face(spread: int, draws: int) -> None:
    """Q_t of a full rank and of less, in units up to 10^±8 of others; error by its rounding, relative to |e| there."""
    for seed in range(draws):
        random = np.random.default_rng(seed)
        n = int(random.integers(1, 7))
        W = random.standard_normal((int(random.integers(1, 2 * n + 1)), n)) * 10.0 ** random.uniform(-spread, spread, n)
        rule = EventTrigger(W.T @ W, float(10.0 ** random.uniform(-3, 3)))
        found = rule.faces(design(n))
        assert found.R.shape == (min(W.shape), n)
        for e in random.standard_normal((4, n)) / np.sqrt(np.diag(rule.Q_t)):
            level = exactly(rule.Q_t, e)
            off = Fraction(float(found.squares(found.R @ e)[0] * rule.q_t**2)) - level
            assert abs(off) < 1e-14 * n * (e**2 @ np.diag(rule.Q_t))
            if len(W) > n:  # no direction has hardly a weight
                assert abs(off) < 1e-12 * level


@pytest.mark.parametrize("Q_t", [[[1e8, 0], [0, -1e-8]], [[1e8, 2], [2, 1e-8]]])
def test_a_weight_that_is_negative_in_small_units_is_refused(Q_t: list[list[float]]) -> None:
    with pytest.raises(AnalysisError, match="negative eigenvalue"):
        EventTrigger(np.array(Q_t), 0.01)
    with pytest.raises(DesignError, match="negative eigenvalue"):
        design_lq(LinearPlant([[0, 1], [1, 0]], [[0], [1]], [[1, 0]]), Q_c=Q_t, R_c=0.1, R_o=0.01)


POLES = """
<mujoco model="poles">
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="a"><joint name="a" axis="0 1 0"/><inertial pos="0 0 1" mass="1" diaginertia="0.1 0.1 0.1"/></body>
    <body name="b"><joint name="b" axis="0 1 0"/><inertial pos="0 0 1" mass="1" diaginertia="0.1 0.1 0.1"/></body>
  </worldbody>
  <actuator><motor name="left" joint="a"/><motor name="right" joint="b"/></actuator>
  <sensor><jointpos name="left" joint="a"/><jointpos name="right" joint="b"/></sensor>
</mujoco>"""
RUN = """
[case]
name = "poles"
title = "Two poles, of which one stands"
[assumed]
model = "poles.xml"
[actual]
gain = 0.9
[design]
R_c = 0.1
R_o = 0.01
[controller]
Q_t = [1e8, 1e-8, 1e8, 1e-8]
q_t = 1e-6
delta_min = 0.01
[simulation]
duration = 5.0
initial = { b = 0.002 }
timestep = 0.005
"""


@pytest.mark.parametrize("plant", ["linear", "mujoco"])
def test_events_come_of_a_state_whose_weight_is_small(plant: str, tmp_path: Path) -> None:
    """Of two poles the one that is weighted little alone moves: its error never passes the threshold."""
    (tmp_path / "poles.xml").write_text(POLES, encoding="utf-8")
    (tmp_path / "run.toml").write_text(RUN, encoding="utf-8")
    run = simulate(prepare(load_run(tmp_path / "run.toml")), plant)
    level = (run.x_h - run.x_o) ** 2 @ np.array([1e8, 1e-8, 1e8, 1e-8])
    assert len(run.events) > 3
    assert 0.9 < level.max() / 1e-12 < 1 + 1e-9


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


def test_a_weight_in_mixed_coordinates_of_any_unit_is_taken_and_weighs_what_it_did() -> None:
    """E against the exact sum of what was given."""
    random = np.random.default_rng(0)
    for _ in range(200):
        n = int(random.integers(1, 8))
        M, R = random.standard_normal((n, n)), random.standard_normal((int(random.integers(1, n + 1)), n))
        units = 10.0 ** random.uniform(-8, 8, n)
        Q, e = M.T @ (R.T @ R) @ M * units * units[:, None], random.standard_normal(n) / units
        found = EventTrigger(Q, 0.5).faces(design(n)).E(e) + 0.25
        exact = sum(Fraction(a) * Fraction(b) * Fraction(c) for a, row in zip(e, Q, strict=True)
                    for b, c in zip(row, e, strict=True))  # fmt: skip
        # what cancels is rounding of what was given
        assert abs(Fraction(found) - exact) < 1e-10 * (np.abs(e) @ np.abs(Q) @ np.abs(e))
