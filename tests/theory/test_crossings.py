"""Crossings against brute force, published values, and systems built to have pairs, tangencies and defects."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar
from theory_cases import SHIPPED, dip, pair_of_holds, random_systems, shipped, step, visiting

from icmj import Delay, EventTrigger, LinearPlant, error_system, predict
from icmj.controller.design import design_lq
from icmj.controller.hold import system_matched, zero_order
from icmj.errors import AnalysisError, DesignError
from icmj.theory import crossings as search_module
from icmj.theory.circle import count_outside
from icmj.theory.crossings import _join, search
from icmj.theory.error_system import ErrorSystem

GRID = 1e-4


def brute_force(system: ErrorSystem, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of φ on a grid of 1e-4 s, stepping e^{Ā_C Δ} of scipy from one point to the next."""
    steps = int(end / GRID)
    block = 100
    inner = np.stack([expm(system.A_C * GRID * (i + 1)) for i in range(block)])
    delta, values, here = [], [], np.eye(len(system.A_C))
    for start in range(0, steps, block):
        E = inner @ here
        here = E[-1]
        delta.append(GRID * (start + 1 + np.arange(block)))
        values.append(np.linalg.eigvals(system.T @ system.A_D @ E @ system.T_bar))
    delta, values = np.concatenate(delta), np.concatenate(values)
    keep = delta <= end
    return delta[keep], values[keep]


def assert_agrees_with_brute_force(system: ErrorSystem, end: float) -> int:
    result = search(system, end)
    delta, values = brute_force(system, result.delta_end)
    magnitude = np.abs(values)
    outside = (magnitude > 1).sum(axis=1)
    # as Δ → 0 the eigenvalues leave +1 like those of the continuous loop
    begin = int((np.linalg.eigvals(system.T @ system.A_C @ system.T_bar).real > 0).sum())
    explained = begin + sum(step(c) * (delta > c.delta) for c in result.crossings) + np.zeros(len(delta), int)
    # a grid point that falls on a crossing itself may be counted either way
    unsure = np.abs(magnitude - 1).min(axis=1) < 1e-7
    np.testing.assert_array_equal(outside[~unsure], explained[~unsure])
    for c in result.crossings:
        exact = np.linalg.eigvals(system.phi(c.delta)).astype(complex)
        i = np.abs(exact - c.eigenvalue).argmin()
        assert abs(exact[i] - c.eigenvalue) < 1e-7
        rest = np.delete(exact, i)
        if c.kind == "complex":
            assert abs(c.eigenvalue.imag) > 0
            rest = np.delete(rest, np.abs(rest - exact[i].conj()).argmin())
        else:
            assert c.eigenvalue == {"+1": 1, "-1": -1}[c.kind]
        assert np.abs(rest).max() == pytest.approx(c.largest_other, abs=1e-6, rel=1e-6)
    return len(result.crossings)


@pytest.mark.slow
def test_random_plants_agree_with_a_brute_force_scan():
    found = [assert_agrees_with_brute_force(system, 2.0) for system in random_systems(1, 30)]
    assert sum(found) >= 25  # enough crossings for the test to mean something


def eigenvalue(delta, q, c, r):
    return np.exp(q * delta) + r * (np.exp(c * delta) - np.exp(q * delta)) / (c - q)


@pytest.mark.parametrize("excess", [1.0, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 2e-11])
def test_pairs_of_crossings_closer_than_any_grid_are_told_apart(excess):
    system, at = dip(1 + excess)
    found = search(system, 3.0).crossings
    assert [c.direction for c in found] == ["rising", "falling"]
    assert {c.kind for c in found} == {"-1"}
    assert found[1].delta - found[0].delta == pytest.approx(at[1] - at[0], rel=1e-2)
    assert found[0].delta == pytest.approx(at[0], abs=1e-7)


def test_a_touch_is_a_tangency_and_a_near_miss_is_nothing():
    found = search(dip(1.0)[0], 3.0).crossings
    assert [(c.kind, c.direction) for c in found] == [("-1", "tangent")]
    assert found[0].largest_other == pytest.approx(np.exp(-found[0].delta), rel=1e-6)
    for short in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10):
        assert search(dip(1 - short)[0], 3.0).crossings == ()


@pytest.mark.parametrize("excess", [1e-1, 1e-3, 1e-5, 1e-7, 1e-9])
def test_a_complex_pair_that_comes_out_and_goes_back(excess):
    q, c = -0.5 + 3j, -2 + 1j

    def largest(size):
        grid = np.linspace(0.5, 4, 400)
        start = grid[np.abs(eigenvalue(grid, q, c, size * np.exp(2.2j))).argmax()]
        hump = minimize_scalar(
            lambda d: -abs(eigenvalue(d, q, c, size * np.exp(2.2j))),
            bounds=(start - 0.05, start + 0.05),
            method="bounded",
            options={"xatol": 1e-9},
        )
        return -hump.fun, hump.x

    size = brentq(lambda s: largest(s)[0] - 1 - excess, 0.5, 20, xtol=1e-14)
    r = complex(size * np.exp(2.2j))
    found = [x for x in search(pair_of_holds(q, c, r), 4.0).crossings if abs(x.delta - largest(size)[1]) < 0.6]
    assert [(x.kind, x.direction) for x in found] == [("complex", "rising"), ("complex", "falling")]
    for x in found:
        lam = eigenvalue(x.delta, q, c, r)
        assert abs(lam) == pytest.approx(1, abs=1e-11)
        assert x.eigenvalue == pytest.approx(complex(lam.real, abs(lam.imag)), abs=1e-9)
    missed = complex(brentq(lambda s: largest(s)[0] - 1 + excess, 0.5, 20, xtol=1e-14) * np.exp(2.2j))
    nothing = search(pair_of_holds(q, c, missed), 4.0).crossings
    assert not [x for x in nothing if abs(x.delta - largest(abs(missed))[1]) < 0.6]


@pytest.mark.parametrize("growth", [-1e-7, -1e-8, 1e-8, 1e-7])
def test_a_slow_oscillator_under_a_hold_of_order_zero_crosses_beside_one_as_a_complex_pair(growth):
    """What is held has no effect over a whole turn, after which the pair, of e^{AΔ} − ∫e^{As}ds B k, is near +1.

    Its determinant is e^{tr A Δ} (1 − k A⁻¹(1 − e^{−AΔ})B), which is 1 where the pair crosses, less than 1e-6 from +1.
    """
    omega = 5.88
    A, B = np.array([[growth, omega], [-omega, growth]]), np.array([[0.3], [1.0]])
    plant = LinearPlant(A, B, [[1.0, 0.0]])
    design = design_lq(plant, R_c=0.1, R_o=0.1)

    def level(delta):
        seen = design.k @ np.linalg.solve(A, B - expm(-A * delta) @ B)
        return 2 * growth * delta + np.log1p(-float(seen[0, 0]))

    turn = 2 * np.pi / omega
    expected = brentq(level, turn - 1e-6, turn + 1e-6, xtol=1e-16)
    found = search(error_system(plant, design, zero_order(design)), 1.2)
    # besides, the two may be real for a while, a tenth of 1e-6 from +1, which counts as a touch
    (there,) = (c for c in found.crossings if abs(c.delta - turn) < 1e-3 and c.direction != "tangent")
    assert (there.kind, there.direction, there.multiplicity) == ("complex", "falling", 1)
    assert there.delta == pytest.approx(expected, abs=1e-13)
    assert 0 < there.eigenvalue.imag < 1e-6
    assert found.unresolved == ()


def test_the_published_failure_is_a_complex_pair_first():
    pair, minus = search(shipped("b=1.7"), 4.0).crossings
    assert (pair.kind, pair.direction) == ("complex", "rising")
    assert pair.delta == pytest.approx(0.476, abs=5e-4)
    assert (minus.kind, minus.eigenvalue) == ("-1", -1)


@pytest.mark.parametrize("case", SHIPPED)
def test_shipped_cases_agree_with_a_brute_force_scan(case):
    assert_agrees_with_brute_force(shipped(case), 3.0)


def test_the_exact_model_has_none():
    assert search(shipped("exact"), 10.0).crossings == ()


def test_a_mode_that_stays_on_the_circle_crosses_nothing():
    system = pair_of_holds(-1.0, -3.0, 0.3)
    stuck = ErrorSystem(system.A_C * (np.arange(3) > 0), system.T_hat, system.actual, system.design)  # λ = 1 throughout
    assert search(stuck, 3.0).crossings == ()
    dipping = dip(1.5)[0]
    stuck = ErrorSystem(dipping.A_C * (np.arange(3) > 0), dipping.T_hat, dipping.actual, dipping.design)
    assert [c.direction for c in search(stuck, 3.0).crossings] == ["rising", "falling"]


def test_the_end_of_the_search_does_not_matter():
    whole = search(shipped("b=1.7"), 4.0).crossings
    for end in (0.5, 1.0, 1.2, 2.7, 4.0):
        np.testing.assert_allclose(
            [c.delta for c in search(shipped("b=1.7"), end).crossings],
            [c.delta for c in whole if c.delta <= end],
            rtol=1e-10,
        )
    assert search(shipped("b=1.7"), 4.0, delta_start=0.5).crossings[0].kind == "-1"


def test_the_search_stops_where_rounding_drowns_the_circle():
    result = search(shipped("b=0.9 three-link"), 30.0)
    assert 3 < result.delta_end < 15
    assert np.abs(np.linalg.eigvals(shipped("b=0.9 three-link").phi(result.delta_end))).max() < 1e9


@pytest.mark.parametrize(("start", "end"), [(0.0, 0.0), (0.0, np.inf), (2.0, 1.0), (-1.0, 1.0)])
def test_an_empty_interval_is_refused(start, end):
    with pytest.raises(AnalysisError, match="start < end"):
        search(shipped("b=0.8"), end, delta_start=start)


def test_a_short_visit_among_many_eigenvalues_is_not_missed():
    """A plant of 19 states in which a pair turns real, leaves through −1 and is back within 2 ms."""
    system = visiting()
    found = [c for c in search(system, 0.3).crossings if 0.1577 < c.delta < 0.161]
    assert [(c.kind, c.direction) for c in found] == [("-1", "rising"), ("-1", "falling")]
    inside, visit = ((np.abs(np.linalg.eigvals(system.phi(d))) > 1).sum() for d in (0.157, 0.159))
    assert visit == inside + 1


def hard_systems(seed, count):
    """Loops of badly scaled and defective plants of 1 to 7 states, with both holds, with and without delay."""
    rng = np.random.default_rng(seed)
    while count:
        n, n_u, n_y, kind = rng.integers(1, 8), rng.integers(1, 3), rng.integers(1, 3), rng.integers(3)
        A = rng.normal(size=(n, n))
        if kind == 1:
            A *= 10 ** rng.uniform(-3, 3, size=n)[:, None]
        elif kind == 2:
            A = rng.normal() * np.eye(n) + np.diag(np.ones(n - 1), 1)
        A *= rng.uniform(1, 30) / max(np.linalg.norm(A, 2), 1e-3)
        A += max(0.3 - np.linalg.eigvals(A).real.max(), 0) * np.eye(n)
        assumed = LinearPlant(A, rng.normal(size=(n, n_u)), rng.normal(size=(n_y, n)))
        share, hold, t_d = 0.3 * rng.uniform(), rng.choice([system_matched, zero_order]), rng.choice([0.0, 0.1])
        actual = LinearPlant(*(M * (1 + share * rng.normal(size=M.shape)) for M in (assumed.A, assumed.B, assumed.C)))
        try:
            design = design_lq(assumed, R_c=10 ** rng.uniform(-3, 0.5), R_o=10 ** rng.uniform(-3, 0.5))
        except DesignError:
            continue
        count -= 1
        yield error_system(actual, design, hold=hold(design), delay=Delay(t_d))


def test_what_the_crossings_leave_unexplained_is_part_of_the_result():
    """Eigenvalues outside of the circle at both ends, counted by SciPy's exponential, against the crossings between."""
    explained = 0
    for system in hard_systems(17, 60):
        try:
            found = search(system, 3.0)
        except AnalysisError:
            continue
        if np.linalg.norm(system.A_C) * found.delta_end > 1e5:  # too few digits hold without balancing
            continue
        ends = np.array([max(2e-5, system.delay.t_d), found.delta_end])
        phis = [system.exit @ expm(system.A_C * (delta - system.delay.t_d)) @ system.entry for delta in ends]
        sizes = [np.abs(np.linalg.eigvals(phi)) for phi in phis]
        if np.abs(np.concatenate(sizes) - 1).min() < 1e-5 or any(c.delta < ends[0] for c in found.crossings):
            continue
        change = int((sizes[1] > 1).sum() - (sizes[0] > 1).sum())
        adds_up = change == sum(step(c) for c in found.crossings)
        assert adds_up or found.unresolved
        assert all(system.delay.t_d <= first < last <= found.delta_end for first, last in found.unresolved)
        explained += adds_up and not found.unresolved
    assert explained > 30


@pytest.mark.parametrize("case", SHIPPED)
def test_nothing_is_unresolved_of_a_shipped_case(case):
    assert search(shipped(case), 3.0).unresolved == ()


def test_parts_that_cancel_or_touch_are_one():
    parts = [(0.2, 0.3, -1), (0.1, 0.2, 1), (0.5, 0.6, 1), (0.6, 0.7, 1), (0.9, 1.0, -2)]
    assert _join(parts) == [(0.5, 0.7, 2), (0.9, 1.0, -2)]
    assert _join([]) == []
    flicker = [(0.1, 0.1, 1), (0.15, 0.15, -1), (0.18, 0.18, 1), (0.5, 0.5, 1)]
    assert _join([(0.1, 0.9, 1), (0.3, 0.4, 1)]) == [(0.1, 0.9, 2)]  # one within another
    assert _join(flicker, 0.06) == [(0.1, 0.18, 1), (0.5, 0.5, 1)]


def test_an_eigenvalue_that_passes_the_circle_between_two_panels_is_not_lost(monkeypatch):
    """By rounding it may be inside where one panel ends and outside where the next begins: the change is on neither."""

    def passing(g, delta):
        return count_outside(g, delta) + (delta[:, :1] >= 0.75)  # panels end every 0.375 s

    monkeypatch.setattr(search_module, "count_outside", passing)
    found = search(shipped("b=0.8"), 3.0)
    assert [c.kind for c in found.crossings] == ["+1"]
    assert found.unresolved == ((0.75, 0.75),)


def test_what_is_unresolved_is_a_remark():
    found = predict(shipped("b=0.8"), EventTrigger(np.eye(2), 0.01))
    (words,) = replace(found, unresolved=((1.25, 1.5),)).remarks
    assert words.startswith("crossings may be missing between 1.25 and 1.5 s")
    assert found.remarks == ()


def test_a_crossing_that_rounding_moves_says_how_far(monkeypatch):
    exact = search(shipped("b=0.8"), 3.0).crossings[0]
    monkeypatch.setattr(search_module, "_ERROR", 1e-6)
    found = search(shipped("b=0.8"), 3.0)
    assert found.unresolved == ()
    (crossing,) = found.crossings
    assert (crossing.delta, exact.uncertainty) == (exact.delta, 0)
    assert 1e-6 * exact.delta < crossing.uncertainty < 1e-3


def test_a_crossing_that_rounding_may_have_moved_is_a_remark():
    found = predict(shipped("b=0.8"), EventTrigger(np.eye(2), 0.01))
    moved = replace(found.crossings[0], delta=0.5, uncertainty=2.6e-5)
    assert replace(found, crossings=(moved,)).remarks == (
        "rounding may have moved the crossing at 0.5 s by up to 3e-05 s",
    )
