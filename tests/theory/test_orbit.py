"""The orbit against an ODE integrator in original coordinates, and its admissibility against built obstacles."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar
from theory_cases import SHIPPED, random_systems, shipped

from icmj.base.bernstein import find_maxima
from icmj.controller.rules.quadratic import EventTrigger
from icmj.errors import AnalysisError
from icmj.theory.crossings import search
from icmj.theory.orbit import compute_orbit
from icmj.theory.prediction import find_critical_crossing

WITH_ORBIT = [c for c in SHIPPED if c != "exact"]


def critical(system, end=4.0):
    crossing, _ = find_critical_crossing(search(system, end).crossings)
    assert crossing is not None
    return crossing.delta, int(crossing.kind)


def integrate(system, start, end, times):
    """(x, x_o, x_h) by DOP853 on plant, observer and hold as they stand in the paper."""
    A, B, C, d = system.actual.A, system.actual.B, system.actual.C, system.design
    n, m = system.n, system.n_hat

    def rhs(_, z):
        x, x_o, x_h = np.split(z, [n, n + m])
        u = -d.k @ x_h
        observer = d.plant.A @ x_o + d.plant.B @ u - d.L @ (d.plant.C @ x_o - C @ x)
        return np.concatenate([A @ x + B @ u, observer, d.A_c @ x_h])

    run = solve_ivp(rhs, (0, end), start, "DOP853", t_eval=times, rtol=1e-12, atol=1e-15)
    return run.y.T


@pytest.mark.parametrize("case", WITH_ORBIT)
def test_orbit_closes_and_meets_the_threshold_under_an_ode_integrator(case):
    system = shipped(case)
    trigger = EventTrigger(np.eye(system.n_hat), 0.01)
    delta, sign = critical(system)
    o = compute_orbit(system, trigger, delta, sign)
    n, m = system.n, system.n_hat
    times = np.unique(np.concatenate([o.t, np.linspace(0, delta, 4001)]))
    z = integrate(system, system.to_original(o.X[0]), delta, times)
    size = np.abs(z).max()
    np.testing.assert_allclose(z[np.isin(times, o.t)], system.to_original(o.X), atol=1e-9 * size)
    np.testing.assert_allclose(z[-1, : n + m], sign * z[0, : n + m], atol=1e-8 * size)
    e = z[-1, n + m :] - z[-1, n : n + m]
    assert e @ e == pytest.approx(trigger.q_t**2, rel=1e-8)
    y, u = z[:, :n] @ system.actual.C.T, -z[:, n + m :] @ system.design.k.T
    for signal, peak, spread in ((y, o.y_peak, o.y_range), (u, o.u_peak, o.u_range), (z[:, :n], o.x_peak, o.x_range)):
        whole = signal if sign > 0 else np.concatenate([signal, -signal])
        np.testing.assert_allclose(np.abs(whole).max(axis=0), peak, rtol=1e-4)
        assert (peak >= np.abs(whole).max(axis=0) * (1 - 1e-9)).all()  # the grid can only fall short
        np.testing.assert_allclose(np.ptp(whole, axis=0), spread, rtol=1e-4)
    assert o.period == (delta if sign > 0 else 2 * delta)
    assert o.admissible
    assert o.reason == ""
    assert (o.E[1:-1] < 0).all()


def test_gamma_is_the_paper_s_and_the_orbit_scales_with_the_threshold():
    system = shipped("b=0.8")
    delta, sign = critical(system)
    small, large = (compute_orbit(system, EventTrigger(np.eye(2), q), delta, sign) for q in (1e-3, 1.0))
    V = small.x_bar / small.gamma
    assert np.linalg.norm(V) == pytest.approx(1.0)
    assert V[np.abs(V).argmax()] > 0
    np.testing.assert_allclose(system.phi(delta) @ V, V, atol=1e-10)
    assert large.gamma == pytest.approx(1000 * small.gamma)
    np.testing.assert_allclose(large.y_peak, 1000 * small.y_peak)


def test_peaks_are_stationary_to_twelve_digits():
    system = shipped("b=1.2")
    delta, sign = critical(system)
    o = compute_orbit(system, EventTrigger(np.eye(2), 0.01), delta, sign)
    # y' = v here, so the peak of y is where v vanishes: locate that by bisection on the exponential
    v = o.X[:, 0]
    i = int(np.flatnonzero(v[:-1] * v[1:] < 0)[0])
    t = brentq(lambda s: (expm(system.A_C * s) @ o.X[0])[0], o.t[i], o.t[i + 1], xtol=1e-15)
    assert abs((expm(system.A_C * t) @ o.X[0])[1]) == pytest.approx(o.y_peak[0], rel=1e-12)


@pytest.mark.parametrize("case", ["b=0.8", "b=1.2"])
def test_the_mirrored_half_counts_in_the_range(case):
    system = shipped(case)
    delta, sign = critical(system)
    o = compute_orbit(system, EventTrigger(np.eye(2), 0.01), delta, sign)
    if sign < 0:
        np.testing.assert_allclose(o.y_range, 2 * o.y_peak)
    else:
        assert (o.y_range < 2 * o.y_peak - 1e-6).all()


def test_not_admissible_below_the_least_interval():
    system = shipped("b=0.8")
    delta, sign = critical(system)
    o = compute_orbit(system, EventTrigger(np.eye(2), 0.01, delta_min=2.0), delta, sign)
    assert not o.admissible
    assert "Δ_min" in o.reason


def test_a_weight_that_does_not_detect_the_orbit_is_named():
    system = shipped("b=0.8")
    delta, sign = critical(system)
    e = compute_orbit(system, EventTrigger(np.eye(2), 0.01), delta, sign).e_hp[-1]
    across = np.array([-e[1], e[0]]) / np.linalg.norm(e)
    o = compute_orbit(system, EventTrigger(np.outer(across, across), 0.01), delta, sign)
    assert not o.admissible
    assert "does not detect" in o.reason
    assert np.isinf(o.gamma)
    assert np.isfinite(o.X).all()


def event_function(system, o, trigger, delta):
    """E on a fine grid of [0, Δ), by scipy's exponential."""
    fine = 4000
    one = expm(system.A_C * delta / fine)
    X, E = o.X[0], []
    for _ in range(fine):
        e = system.T_t @ X
        E.append(e @ trigger.Q_t @ e - trigger.q_t**2)
        X = one @ X
    return np.array(E)


@pytest.mark.slow
def test_admissibility_agrees_with_a_fine_grid_for_any_semidefinite_weight():
    rng = np.random.default_rng(8)
    verdicts = []
    for system in random_systems(17, 160):
        crossing, _ = find_critical_crossing(search(system, 2.0).crossings)
        if crossing is None:
            continue
        w = rng.normal(size=(1, system.n_hat))
        trigger = EventTrigger(w.T @ w, 0.01, 0.0)
        o = compute_orbit(system, trigger, crossing.delta, int(crossing.kind))
        E = event_function(system, o, trigger, crossing.delta)
        if (E >= 0).any():
            assert not o.admissible
        elif E[:-40].max() < -1e-4 * trigger.q_t**2 and np.diff(E[-40:]).min() > 0:
            assert o.admissible, o.reason
        verdicts.append(o.admissible)
    assert sum(verdicts) > 5
    assert len(verdicts) - sum(verdicts) >= 5


@pytest.mark.parametrize(
    ("case", "low", "high"), [("b=0.8", 2.25, 2.27), ("b=1.2", 2.215, 2.23), ("b=1.7", 2.05, 2.06)]
)
def test_an_event_function_that_touches_zero_between_samples_is_an_earlier_event(case, low, high):
    """Q_t = wwᵀ with w turned until E just touches zero in mid-interval; the touch lasts microseconds."""
    system = shipped(case)
    delta, sign = critical(system)
    base = compute_orbit(system, EventTrigger(np.eye(2), 0.01), delta, sign)

    def ratio(tau, w):
        return (w @ system.T_t @ expm(system.A_C * tau) @ base.X[0]) ** 2 / (w @ base.e_hp[-1]) ** 2

    def excess(angle):
        w = np.array([np.cos(angle), np.sin(angle)])
        how = {"bounds": (0.3 * delta, 0.8 * delta), "method": "bounded", "options": {"xatol": 1e-10}}
        hump = minimize_scalar(lambda tau: -ratio(tau, w), **how)
        return -hump.fun - 1

    touch = brentq(excess, low, high, xtol=1e-15)
    for shift, admissible in ((-1e-8, True), (1e-8, False)):
        angle = touch + shift
        assert (excess(angle) < 0) == admissible
        assert abs(excess(angle)) < 1e-6
        w = np.array([np.cos(angle), np.sin(angle)])
        o = compute_orbit(system, EventTrigger(np.outer(w, w), 0.01), delta, sign)
        assert o.admissible == admissible, o.reason
        assert (o.E[:-1] < 0).all()  # no sample of the grid sees it


@pytest.mark.parametrize(("delta", "sign"), [(0.0, 1), (np.nan, 1), (1.0, 0)])
def test_nonsense_is_refused(delta, sign):
    with pytest.raises(AnalysisError):
        compute_orbit(shipped("b=0.8"), EventTrigger(np.eye(2), 0.01), delta, sign)


def test_a_weight_of_the_wrong_size_is_refused():
    with pytest.raises(AnalysisError, match="Q_t"):
        compute_orbit(shipped("b=0.8"), EventTrigger(np.eye(3), 0.01), 1.8, 1)


def test_maxima_find_a_bump_narrower_than_any_grid_and_agree_with_roots_of_the_derivative():
    square = np.array([0.09 + 1e-12, -0.6, 1.0])
    p = -np.polynomial.polynomial.polymul(square, [1.0, 1.0])
    found = find_maxima(np.stack([p, p - 1], axis=1)[:, :, None])
    assert found.value[0] == pytest.approx(-1.3e-12, abs=1e-14)
    assert found.cell[0] == 0
    assert found.s[0] == pytest.approx(0.3, abs=1e-5)
    rng = np.random.default_rng(5)
    for _ in range(200):
        p = rng.normal(size=12)
        s = np.roots(np.polynomial.polynomial.polyder(p)[::-1])
        s = s[(np.abs(s.imag) < 1e-12) & (s.real > 0) & (s.real < 1)].real
        expected = np.polynomial.polynomial.polyval(np.concatenate([[0, 1], s]), p).max()
        assert find_maxima(p[:, None, None]).value[0] == pytest.approx(expected, abs=1e-12)
