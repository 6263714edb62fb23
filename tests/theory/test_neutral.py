"""Modes that no event can change: a correct attracting cycle stays one beside them, and they are named."""

from dataclasses import replace

import numpy as np
import pytest
import theory_cases as cases
from scipy.linalg import block_diag
from theory_cases import (
    SHIPPED,
    beside,
    pendulum_design,
    random_systems,
    shipped,
    system_beside,
    three_link,
    three_link_design,
)

from icmj import Controller, Delay, Design, EventTrigger, LinearPlant, Settings, predict, system_matched
from icmj.errors import AnalysisError
from icmj.linear.run import simulate
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.reduction import is_stable_modulo_neutral, reduce_system

PLAIN = 1.8065  # Δ_crit of the pendulum alone [s], notes, section 4


def rule(system: ErrorSystem) -> EventTrigger:
    weight = np.zeros((system.n_hat,) * 2)
    weight[:2, :2] = np.eye(2)
    return EventTrigger(weight, 0.01)


UNSEEN = {
    "integrator": {"extra": cases.INTEGRATOR},
    "integrator of y": {"extra": cases.INTEGRATOR, "driven": [[0, 1]]},
    "integrator of y that the model lacks": {"extra": cases.INTEGRATOR, "driven": [[0, 1]], "known": False},
    "two integrators": {"extra": np.zeros((2, 2)), "driven": [[0, 1], [1, 0]]},
    "double integrator": {"extra": cases.DOUBLE},
    "driven double integrator": {"extra": cases.DOUBLE, "driven": [[0, 0], [0, 1]]},
    "double integrator that the model lacks": {"extra": cases.DOUBLE, "known": False},
    "oscillator": {"extra": cases.OSCILLATOR, "driven": [[0, 1], [0, 0]]},
}


@pytest.mark.parametrize("case", UNSEEN)
@pytest.mark.parametrize("gain", [0.8, 1.2, 1.7])
def test_what_nothing_sees_changes_nothing_but_is_named(case, gain):
    system, plain = system_beside(**UNSEEN[case], gain=gain), shipped(f"b={gain}")
    found, expected = predict(system, rule(system)), predict(plain, EventTrigger(np.eye(2), 0.01))
    assert found.delta_crit == pytest.approx(expected.delta_crit, rel=1e-11)
    assert (found.verdict, found.cycle, found.period) == (
        expected.verdict,
        expected.cycle,
        pytest.approx(expected.period, rel=1e-11) if expected.cycle else None,
    )
    np.testing.assert_allclose(found.multipliers, expected.multipliers, atol=1e-9)
    assert [(c.kind, c.direction) for c in found.crossings] == [(c.kind, c.direction) for c in expected.crossings]
    for a, b in zip(found.crossings, expected.crossings, strict=True):
        assert a.largest_other == pytest.approx(b.largest_other, rel=1e-9)
    np.testing.assert_allclose(found.amplitude, expected.amplitude, rtol=1e-9)
    assert (found.state_feedback_stable, found.observer_feedback_stable) == (
        expected.state_feedback_stable,
        expected.observer_feedback_stable,
    )
    assert expected.neutral == ()
    assert {m.kind for m in found.neutral} == {"neutral"}
    assert {name for m in found.neutral for name in m.states} == set(system.actual.states[2:])
    assert all("unobservable" in m.words and m.seen_by == () for m in found.neutral)
    frequencies = {round(abs(rate.imag), 6) for m in found.neutral for rate in m.rates}
    assert frequencies == ({3.0} if case == "oscillator" else {0.0})
    assert all(abs(rate.real) == 0 for m in found.neutral for rate in m.rates)


def mixed(plant: LinearPlant, M: np.ndarray) -> LinearPlant:
    return LinearPlant(np.linalg.solve(M, plant.A @ M), np.linalg.solve(M, plant.B), plant.C @ M)


@pytest.mark.parametrize("condition", [1.0, 10.0])
@pytest.mark.parametrize("extra", [cases.DOUBLE, np.eye(3, k=1), block_diag(np.eye(3, k=1), [[-0.03]])])
def test_a_chain_of_integrators_is_neutral_in_any_coordinates(extra, condition):
    """Rounding makes a ring of k equal eigenvalues, as wide as its k-th root; a slow mode beside it is none of them."""
    rng, own, m = np.random.default_rng(4), three_link_design(), len(extra)
    plain = predict(error_system(three_link(0.9), own), EventTrigger(np.eye(6), 0.01))

    def widened(plant: LinearPlant) -> LinearPlant:
        return LinearPlant(
            block_diag(plant.A, extra), np.pad(plant.B, ((0, m), (0, 0))), np.pad(plant.C, ((0, 0), (0, m)))
        )

    k, L = np.pad(own.k, ((0, 0), (0, m))), np.pad(own.L, ((0, m), (0, 0)))
    weight = np.diag(np.repeat([1.0, 0.0], [6, m]))
    for _ in range(4):
        turns = [np.linalg.qr(rng.normal(size=(6 + m, 6 + m)))[0] for _ in range(2)]
        M = turns[0] * np.geomspace(1, condition, 6 + m) @ turns[1]
        actual, assumed = (mixed(widened(three_link(gain)), M) for gain in (0.9, 1.0))
        system = error_system(actual, Design(assumed, k @ M, np.linalg.solve(M, L)))
        found = predict(system, EventTrigger(M.T @ weight @ M, 0.01))
        assert [mode.kind for mode in found.neutral] == ["neutral"]
        assert found.neutral[0].rates == (0,) * 2 * int((np.diag(extra) == 0).sum())
        assert [(c.kind, c.direction) for c in found.crossings] == [(c.kind, c.direction) for c in plain.crossings]
        assert found.delta_crit == pytest.approx(plain.delta_crit, rel=1e-7)
        assert (found.verdict, found.cycle) == (plain.verdict, plain.cycle)
        assert (found.state_feedback_stable, found.observer_feedback_stable) == (True, True)


@pytest.mark.parametrize("case", ["integrator of y", "driven double integrator", "oscillator"])
def test_the_simulated_loop_settles_on_the_interval_predicted_beside_a_neutral_mode(case):
    system = system_beside(**UNSEEN[case])
    prediction = predict(system, rule(system))
    controller = Controller(system.design, system_matched(system.design), rule(system))
    x0 = np.zeros(system.n)
    x0[1:3] = 0.02, 5.0
    run = simulate(system.actual, controller, Settings(duration=80.0, record_interval=1e3, limit=1e9), x0=x0)
    intervals = np.diff(run.events.t)[-5:]
    np.testing.assert_allclose(intervals, prediction.delta_crit, rtol=1e-9)


@pytest.mark.parametrize("case", UNSEEN)
def test_the_orbit_closes_but_for_its_drift(case):
    system = system_beside(**UNSEEN[case])
    orbit = predict(system, rule(system)).orbit
    phi, size = system.phi(orbit.delta), np.abs(orbit.x_bar).max()
    np.testing.assert_allclose(phi @ orbit.x_bar, orbit.x_bar + orbit.drift, atol=1e-9 * size)
    # only states that nothing sees may drift, and only where the mean of y, which is not zero, drives an integrator
    np.testing.assert_allclose(orbit.drift[:2], 0, atol=1e-9 * size)
    assert (np.abs(orbit.drift).max() > 1e-6 * size) == (
        case
        in ("integrator of y", "integrator of y that the model lacks", "two integrators", "driven double integrator")
    )
    assert np.isnan(orbit.x_peak[2:]).all()  # any constant may be added there
    assert np.isfinite(orbit.x_peak[:2]).all()
    assert np.isfinite(orbit.y_peak).all()


def test_the_critical_row_does_not_see_the_neutral_mode():
    system = system_beside(cases.INTEGRATOR, driven=[[0, 1]])
    p = predict(system, rule(system))
    assert p.V_inv.shape == (6, 6)
    assert p.V_inv[0] @ p.orbit.x_bar == pytest.approx(p.orbit.gamma, rel=1e-10)
    moved = p.orbit.x_bar + np.array([0, 0, 7.0, 0, 0, 0])
    assert p.V_inv[0] @ moved == pytest.approx(p.orbit.gamma, rel=1e-9)
    assert np.linalg.cond(p.V_inv) < 1e6


@pytest.mark.parametrize("known", [True, False])
def test_a_drift_that_an_output_shows_is_named_with_the_output(known):
    if not known:
        # an output that the model believes to be always zero
        plain, actual = pendulum_design(), beside(0.8, cases.INTEGRATOR, driven=[[0, 1]], shown=[1])
        assumed = LinearPlant(plain.plant.A, plain.plant.B, np.vstack([plain.plant.C, [[0, 0]]]), cases.NAMES)
        system = error_system(actual, Design(assumed, plain.k, np.hstack([plain.L, np.zeros((2, 1))])))
    else:
        system = system_beside(cases.INTEGRATOR, driven=[[0, 1]], shown=[1])
    p = predict(system, rule(system))
    assert p.delta_crit == pytest.approx(PLAIN, abs=1e-4)
    assert p.verdict == "attracting"
    (mode,) = p.neutral
    assert (mode.kind, mode.states, mode.seen_by) == ("neutral", ("p",), ("place",))
    assert "up to a drift of place" in mode.words
    np.testing.assert_array_equal(np.isnan(p.amplitude), [False, True])
    np.testing.assert_array_equal(np.isnan(p.orbit.y_range), [False, True])  # it drifts: no range


@pytest.mark.parametrize("known", [True, False])
def test_an_unstable_mode_that_nothing_sees_is_not_hidden(known):
    p = predict(system := system_beside(cases.GROWING, known=known), rule(system))
    assert (p.verdict, p.cycle) == ("attracting", True)
    assert p.delta_crit == pytest.approx(PLAIN, abs=1e-4)
    (mode,) = p.neutral
    assert (mode.kind, mode.states) == ("unstable", ("p",))
    assert mode.rates[0] == pytest.approx(0.5)
    assert "unobservable unstable mode; the state diverges" in mode.words
    assert not p.observer_feedback_stable
    assert not p.state_feedback_stable


def test_an_unstable_mode_that_an_output_shows_stays_in_the_analysis():
    p = predict(system := system_beside(cases.GROWING, shown=[1]), rule(system))
    assert not p.cycle
    assert not p.observer_feedback_stable
    # the plant's own is shown; the observer's copy of it, which starts anywhere and is corrected by nothing, is not
    assert [m.states for m in p.neutral] == [("observer's p",)]


def test_a_constant_disturbance_is_an_offset_that_shifts_the_cycle():
    """v' = y + 0.8 u + d with d constant: the loop sees d and cannot change it."""
    A = [[0, 1, 1], [1, 0, 0], [0, 0, 0]]
    actual = LinearPlant(A, [[0.8], [0], [0]], [[0, 1, 0]], (*cases.NAMES, "d"), ("u",), ("y",))
    system = error_system(actual, pendulum_design())
    p = predict(system, EventTrigger(np.eye(2), 0.01))
    assert p.delta_crit == pytest.approx(PLAIN, abs=1e-4)
    assert p.verdict == "attracting"
    (mode,) = p.neutral
    assert (mode.kind, mode.states) == ("offset", ("d",))
    assert p.orbit.x_bar[2] == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(system.phi(p.delta_crit) @ p.orbit.x_bar, p.orbit.x_bar, atol=1e-9)
    assert p.state_feedback_stable


def test_a_mode_that_the_control_sees_is_not_neutral():
    """The same integrator, measured and fed back: whatever becomes of it, it is not taken out."""
    plain = pendulum_design()
    kinds = [beside(gain, cases.INTEGRATOR, driven=[[0, 1]], shown=[1]) for gain in (1.0, 0.8)]
    design = Design(kinds[0], np.hstack([plain.k, [[0.5]]]), block_diag(plain.L, [[1.0]]))
    assert reduce_system(error_system(kinds[1], design)).modes == ()


@pytest.mark.parametrize("case", SHIPPED)
def test_the_shipped_cases_have_none(case):
    assert reduce_system(shipped(case)).modes == ()


def test_random_plants_beside_unseen_modes_in_mixed_states():
    """Crossings of a random plant do not change when hidden modes are added and all states are mixed."""
    from icmj.theory.crossings import search

    rng = np.random.default_rng(8)
    for system in random_systems(41, 25):
        hidden = np.asarray((cases.INTEGRATOR, cases.DOUBLE, cases.OSCILLATOR, cases.GROWING)[rng.integers(4)])
        n, m, h = system.n, system.n_hat, len(hidden)
        mixing = [np.linalg.qr(rng.normal(size=(size + h,) * 2))[0] for size in (n, m)]

        def wide(plant, S, hidden=hidden, h=h):
            A = block_diag(plant.A, hidden)
            A[plant.n :, : plant.n] = rng.normal(size=(h, plant.n))
            B = np.vstack([plant.B, rng.normal(size=(h, plant.n_u))])
            C = np.hstack([plant.C, np.zeros((plant.n_y, h))])
            return LinearPlant(S.T @ A @ S, S.T @ B, C @ S)

        design = Design(
            wide(system.design.plant, mixing[1]),
            np.hstack([system.design.k, np.zeros((system.actual.n_u, h))]) @ mixing[1],
            mixing[1].T @ np.vstack([system.design.L, rng.normal(size=(h, system.actual.n_y))]),
        )
        whole = error_system(wide(system.actual, mixing[0]), design)
        found, expected = search(whole, 2.0).crossings, search(system, 2.0).crossings
        assert [(c.kind, c.direction) for c in found] == [(c.kind, c.direction) for c in expected]
        np.testing.assert_allclose([c.delta for c in found], [c.delta for c in expected], rtol=1e-6)
        assert sum(len(mode.rates) for mode in reduce_system(whole).modes) == 2 * h


def test_stability_modulo_neutral_modes_of_small_matrices():
    b, c = np.array([[1.0], [0.0]]), np.array([[1.0, 0.0]])
    assert is_stable_modulo_neutral(np.diag([-1.0, 0.0]), b, c)
    assert not is_stable_modulo_neutral(np.diag([-1.0, 0.1]), b, c)
    assert not is_stable_modulo_neutral(np.diag([0.0, -1.0]), b, c)
    assert is_stable_modulo_neutral(np.array([[-1.0, 1.0], [0.0, 0.0]]), b, c)  # seen, but not to be changed


@pytest.mark.parametrize("case", ["integrator", "double integrator"])
def test_with_a_delay_a_neutral_mode_is_refused_by_its_name(case):
    system = replace(system_beside(**UNSEEN[case]), delay=Delay(0.1))
    states = system.actual.states[2:]
    with pytest.raises(AnalysisError, match=r"not analysable with a delay: .*neutral.* drop = \[") as caught:
        predict(system, rule(system))
    assert all(f'"{state}"' in str(caught.value) for state in states)
    assert predict(replace(shipped("b=0.8"), delay=Delay(0.1)), EventTrigger(np.eye(2), 0.01)).delta_crit
