"""Repeated eigenvalues: systems put side by side with themselves, their states mixed, against one of them alone."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.linalg import block_diag
from theory_cases import (
    dip,
    pair_of_holds,
    pendulum,
    pendulum_design,
    random_systems,
    shipped,
    step,
    system_beside,
    whole,
)

from icmj import Controller, Delay, Design, EventTrigger, LinearPlant, Settings, predict, system_matched, zero_order
from icmj.controller.delay import NO_DELAY
from icmj.linear.run import simulate
from icmj.theory.crossings import search
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.event_maps import compute_jacobians
from icmj.theory.orbit_family import divide_by_family, list_mixtures


def orthogonal(rng, size):
    return np.linalg.qr(rng.normal(size=(size, size)))[0]


def side_by_side(systems: list[ErrorSystem], rng=None) -> ErrorSystem:
    """Systems beside each other, by default undisturbed; states, inputs and outputs mixed if ``rng`` is given."""

    def joined(plants, S, U, Y):
        A, B, C = (block_diag(*(getattr(p, name) for p in plants)) for name in "ABC")
        return LinearPlant(S.T @ A @ S, S.T @ B @ U, Y @ C @ S)

    actual, assumed = [s.actual for s in systems], [s.design.plant for s in systems]
    sizes = [sum(getattr(p, n) for p in plants) for plants, n in ((actual, "n"), (assumed, "n"))]
    inputs, outputs = sum(p.n_u for p in actual), sum(p.n_y for p in actual)
    S, R, U, Y = ((orthogonal(rng, n) if rng else np.eye(n)) for n in (*sizes, inputs, outputs))
    k, L = block_diag(*(s.design.k for s in systems)), block_diag(*(s.design.L for s in systems))
    design = Design(joined(assumed, R, U, Y), U.T @ k @ R, R.T @ L @ Y.T)
    return error_system(joined(actual, S, U, Y), design, T_hat=R.T @ block_diag(*(s.T_hat for s in systems)) @ S)


def assert_multiplied(whole: ErrorSystem, alone: ErrorSystem, k: int, end: float) -> int:
    one, many = search(alone, end), search(whole, end)
    common = min(one.delta_end, many.delta_end)
    expected = [c for c in one.crossings if c.delta <= common]
    found = [c for c in many.crossings if c.delta <= common]
    assert [(c.kind, c.direction) for c in found] == [(c.kind, c.direction) for c in expected]
    for a, b in zip(found, expected, strict=True):
        assert a.delta == pytest.approx(b.delta, rel=1e-7)
        assert a.eigenvalue == pytest.approx(b.eigenvalue, abs=1e-6)
        assert (a.multiplicity, b.multiplicity) == (k, 1)
        assert a.dimension == k
        assert a.largest_other == pytest.approx(b.largest_other, rel=1e-5, abs=1e-7)
    return len(found)


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("k", [2, 3])
def test_random_plants_beside_themselves_cross_k_fold(mixed, k):
    rng = np.random.default_rng(17)
    found = sum(
        assert_multiplied(side_by_side([system] * k, rng if mixed else None), system, k, 2.0)
        for system in random_systems(61, 30)
    )
    assert found >= 25


@pytest.mark.parametrize("case", ["b=0.8", "b=1.2", "b=1.7", "b=0.9 three-link", "zeta=0.1"])
def test_shipped_plants_beside_themselves_cross_twice(case):
    assert_multiplied(side_by_side([shipped(case)] * 2, np.random.default_rng(1)), shipped(case), 2, 4.0)


def test_numbers_outside_stay_consistent_with_the_crossings():
    rng = np.random.default_rng(3)
    for system in random_systems(62, 10):
        other = next(iter(random_systems(int(rng.integers(1000)), 1)))
        whole = side_by_side([system, system, other], rng)
        result = search(whole, 1.5)
        begin = int((np.linalg.eigvals(whole.T @ whole.A_C @ whole.T_bar).real > 0).sum())
        for delta in np.linspace(0.01, result.delta_end, 60):
            magnitude = np.abs(np.linalg.eigvals(whole.phi(delta)))
            if np.abs(magnitude - 1).min() > 1e-6:
                explained = sum(step(c) for c in result.crossings if c.delta < delta)
                assert (magnitude > 1).sum() == begin + explained


@pytest.mark.parametrize("excess", [1e-2, 1e-6, 1e-10])
def test_close_pairs_of_repeated_crossings_are_told_apart(excess):
    system, at = dip(1 + excess)
    A_C = np.kron(system.A_C, np.eye(2))
    one = LinearPlant(-np.eye(2), np.eye(2), np.eye(2))
    whole = ErrorSystem(A_C, np.zeros((2, 2)), one, Design(one, np.zeros((2, 2)), np.zeros((2, 2))))
    found = search(whole, 3.0).crossings
    assert [(c.direction, c.multiplicity) for c in found] == [("rising", 2), ("falling", 2)]
    np.testing.assert_allclose([c.delta for c in found], at, atol=1e-7)


def test_a_rising_and_a_falling_branch_that_cross_together_are_two_crossings():
    """λ = e^{−3Δ} + a(…) built to pass −1 at the same Δ, one on the way out and one on the way back."""
    system, at = dip(1.5)
    # the second copy runs faster, so that where it comes back is where the first goes out
    faster = ErrorSystem(system.A_C * (at[1] / at[0]), system.T_hat, system.actual, system.design)
    A = np.zeros((6, 6))
    for i, part in enumerate((system.A_C, faster.A_C)):
        A[i::2, i::2] = part
    one = LinearPlant(-np.eye(2), np.eye(2), np.eye(2))
    whole = ErrorSystem(A, np.zeros((2, 2)), one, Design(one, np.zeros((2, 2)), np.zeros((2, 2))))
    found = search(whole, 3.0).crossings
    ratio = at[1] / at[0]
    expected = sorted([(at[0] / ratio, "rising"), (at[0], "falling"), (at[0], "rising"), (at[1], "falling")])
    assert [(pytest.approx(d, rel=1e-6), w) for d, w in expected] == sorted(
        [(c.delta, c.direction) for c in found], key=lambda c: (round(c[0], 6), c[1])
    )


def test_one_pendulum_driving_another_has_a_defective_crossing_and_no_cycle():
    """Block triangular: the second pendulum feels the first. Two equal eigenvalues, one eigenvector."""
    plain, gain = pendulum_design(), 0.8

    def pair(b):
        A = block_diag(pendulum().A, pendulum().A)
        A[2, 1] = 0.3
        return LinearPlant(A, block_diag(pendulum(b).B, pendulum(b).B), block_diag(pendulum().C, pendulum().C))

    system = error_system(pair(gain), Design(pair(1.0), block_diag(plain.k, plain.k), block_diag(plain.L, plain.L)))
    first = search(system, 3.0).crossings[0]
    assert first.delta == pytest.approx(1.8065, abs=1e-3)
    assert (first.kind, first.multiplicity, first.dimension) == ("+1", 2, 1)
    assert not predict(system, EventTrigger(np.eye(4), 0.01)).cycle


@pytest.mark.parametrize("gain", [0.8, 1.2])
@pytest.mark.parametrize("mixed", [False, True])
def test_two_pendulums_side_by_side_have_a_family_of_cycles(gain, mixed):
    alone = shipped(f"b={gain}")
    expected = predict(alone, EventTrigger(np.eye(2), 0.01))
    system = side_by_side([alone, alone], np.random.default_rng(4) if mixed else None)
    rule = EventTrigger(np.eye(4), 0.01)
    p = predict(system, rule)
    assert p.delta_crit == pytest.approx(expected.delta_crit, rel=1e-10)
    assert (p.cycle, p.verdict, p.eigenvalue) == (True, "family", expected.eigenvalue)
    assert p.period == pytest.approx(expected.period, rel=1e-10)
    assert p.crossings[0].multiplicity == 2
    family, sign = p.family, int(expected.eigenvalue.real)
    assert (family.dimension, family.tried, family.admissible, family.attracting) == (2, 4, 4, 4)
    assert f"1 multiplier exactly {sign:+d}" in family.words
    np.testing.assert_allclose(system.phi(p.delta_crit) @ family.basis, sign * family.basis, atol=1e-9)
    np.testing.assert_allclose(system.phi(p.delta_crit) @ p.orbit.x_bar, sign * p.orbit.x_bar, atol=1e-9)
    # all but the neutral multiplier: those of one pendulum, and for the other the eigenvalues of φ without ±1
    values = np.linalg.eigvals(alone.phi(expected.delta_crit))
    other = np.delete(values, np.abs(values - sign).argmin())
    magnitudes = np.sort(np.abs(np.concatenate([expected.multipliers, other])))
    np.testing.assert_allclose(np.sort(np.abs(p.multipliers)), magnitudes, atol=1e-7)
    assert p.amplitude is None  # a mixture of shapes has any ratio of amplitudes
    assert p.V_inv is None


@pytest.mark.parametrize("seed", range(4))
def test_two_pendulums_settle_on_the_predicted_interval_whatever_the_ratio_of_their_amplitudes(seed):
    rng = np.random.default_rng(seed)
    system = side_by_side([shipped("b=0.8")] * 2, rng if seed % 2 else None)
    rule = EventTrigger(np.eye(4), 0.01)
    controller = Controller(system.design, system_matched(system.design), rule)
    x0 = 0.02 * rng.normal(size=4)
    run = simulate(system.actual, controller, Settings(duration=90.0, record_interval=1e3, limit=1e6), x0=x0)
    p = predict(system, rule)
    np.testing.assert_allclose(np.diff(run.events.t)[-5:], p.delta_crit, rtol=1e-9)
    # and what it settles on is a member of the family
    x_bar = system.from_original(np.concatenate([run.events.x, run.events.x_o, run.events.x_o], axis=1))[-2, :8]
    rest = x_bar - p.family.basis @ np.linalg.lstsq(p.family.basis, x_bar)[0]
    assert np.abs(rest).max() < 1e-7 * np.abs(x_bar).max()


def test_a_family_beside_a_neutral_mode():
    alone = system_beside([[0.0]], driven=[[0, 1]])
    p = predict(side_by_side([alone, alone]), EventTrigger(np.diag([1.0, 1, 0, 1, 1, 0]), 0.01))
    assert (p.cycle, p.verdict, p.family.dimension) == (True, "family", 2)
    assert sum(len(mode.rates) for mode in p.neutral) == 4


def test_mixtures_span_the_family():
    for k in (1, 2, 3, 6):
        assert np.linalg.matrix_rank(list_mixtures(k)) == k
    assert len(list_mixtures(1)) == 1


def test_what_is_left_modulo_a_family_is_the_quotient():
    rng = np.random.default_rng(6)
    S = rng.normal(size=(5, 5))
    J = S @ np.diag([1.0, 1.0, 0.0, 0.5, -0.3]) @ np.linalg.inv(S)
    left = np.linalg.eigvals(divide_by_family(J, S[:, :3], 1))
    np.testing.assert_allclose(np.sort(left.real), [-0.3, 0.0, 0.5], atol=1e-10)


def events_beside(system: ErrorSystem, hold, rule, orbit, seed: int, events: int) -> np.ndarray:
    """x̄ at the events of a run from 1e-3 beside an orbit, relative to its size."""
    size, rng = np.linalg.norm(orbit.x_bar), np.random.default_rng(seed)
    away = rng.normal(size=len(orbit.x_bar))
    start = whole(system, orbit.x_bar + 1e-3 * size * away / np.linalg.norm(away))
    x, x_o, x_h = np.split(start, [system.n, system.n + system.n_hat])
    settings = Settings(duration=(events + 2) * orbit.delta, record_interval=1e3, limit=1e6)
    controller = Controller(system.design, hold, rule, system.delay)
    run = simulate(system.actual, controller, settings, x0=x, x_o0=x_o, x_h0=x_h).events
    held = run.x_h if system.delay else run.x_o
    return system.from_original(np.hstack([run.x, run.x_o, held]))[:, : len(orbit.x_bar)] / size


def assert_such_families(systems: Iterator[ErrorSystem], delays: list[Delay]) -> tuple[int, int]:
    """One multiplier is +1 by structure: it neither makes an orbit repel nor leaves it isolated.

    Returns:
        beside how many orbits runs settled, and how many they left.
    """
    settled, left = 0, 0
    for seed, (matched, delay) in enumerate(zip(systems, delays, strict=True)):
        hold, rule = zero_order(matched.design), EventTrigger(np.eye(matched.n_hat), 0.01, 1e-4)
        system = error_system(matched.actual, matched.design, hold, delay=delay)
        p = predict(system, rule, delta_max=2.0)
        if p.verdict not in ("family", "repelling"):
            assert p.verdict != "attracting"
            continue
        J, one = compute_jacobians(system, rule, p.orbit)[0], np.eye(system.n_hat)
        row = p.orbit.e_hp[-1] @ np.hstack([system.T_hat, one, 0 * one]) @ system.lift
        np.testing.assert_allclose(row @ J, row, atol=1e-7 * np.abs(row).max() * np.abs(J).max())
        assert len(p.multipliers) == len(J) - 1
        largest = np.abs(p.multipliers).max()
        assert (p.verdict == "family") == (largest < 1)
        if 0.85 < largest < 1.15:
            continue
        at = events_beside(system, hold, rule, p.orbit, seed, 120)
        gap = min(np.linalg.norm(at[-1] - side * p.orbit.x_bar / np.linalg.norm(p.orbit.x_bar)) for side in (1, -1))
        if p.verdict == "family":
            assert 1e-6 < gap < 0.1
            assert np.abs(at[-1] - at[-3]).max() < 1e-6
            settled += 1
        else:
            assert gap > 0.05
            left += 1
    return settled, left


def test_with_a_zero_order_hold_a_mirrored_orbit_is_one_of_a_family_and_runs_settle_beside_it():
    settled, left = assert_such_families(random_systems(5, 40), [NO_DELAY] * 40)
    assert settled >= 8
    assert left >= 5


@pytest.mark.slow
def test_a_delay_that_is_not_predicted_leaves_such_families():
    """An action sets the hold to what the observer was at its event, however late it is."""
    delays = [Delay(t_d, 0.0) for t_d in np.random.default_rng(6).uniform(0.01, 0.12, 40)]
    settled, left = assert_such_families(random_systems(5, 40), delays)
    assert settled >= 8
    assert left >= 5


@pytest.mark.parametrize("predicted", [0.05, 0.02])
def test_a_zero_order_hold_has_no_such_family_with_a_predicted_delay(predicted):
    design = pendulum_design()
    system = error_system(pendulum(1.2), design, zero_order(design), delay=Delay(0.05, predicted))
    p = predict(system, EventTrigger(np.eye(2), 0.01))
    assert p.eigenvalue == -1
    assert len(p.multipliers) == 6
    assert np.abs(p.multipliers - 1).min() > 1e-3


def test_a_complex_pair_repeated():
    q, c, r = -0.5 + 3j, -2 + 1j, 4 * np.exp(2.2j)
    alone = pair_of_holds(q, c, complex(r))
    expected = [x for x in search(alone, 4.0).crossings if x.kind == "complex"]
    A = np.kron(alone.A_C, np.eye(2))
    plant = LinearPlant(-np.eye(2), np.eye(2), np.eye(2))
    model = LinearPlant(-np.eye(4), np.ones((4, 2)), np.ones((2, 4)))
    whole = ErrorSystem(A, np.zeros((4, 2)), plant, Design(model, np.zeros((2, 4)), np.zeros((4, 2))))
    found = [x for x in search(whole, 4.0).crossings if x.kind == "complex"]
    assert len(found) == len(expected) > 0
    for a, b in zip(found, expected, strict=True):
        assert (a.multiplicity, a.direction) == (2, b.direction)
        assert a.delta == pytest.approx(b.delta, rel=1e-9)
