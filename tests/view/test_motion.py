"""Rates, x̄ and its modes, against the closed loop that they describe."""

from dataclasses import replace

import numpy as np
import pytest
from report_cases import result
from scipy.linalg import expm

from icmj.case.motion import curve, modes, output_rate, reduce_state
from icmj.linear.run import simulate
from icmj.theory.error_system import error_system

CYCLES = ["b0.8", "b1.2", "three-link", "neglected"]


@pytest.mark.parametrize("name", ["three-link", "neglected"])
def test_the_rate_is_the_derivative_of_the_output(name: str) -> None:
    found = result(name)
    s = found.simulation
    middle = slice(200, 260)
    t, y = s.t[middle], s.y[middle]
    slope = np.gradient(y, t, axis=0, edge_order=2)
    rate = output_rate(found, s.x[middle], s.u[middle])
    between_events = np.min(np.abs(t[:, None] - s.events.t), axis=1) > 0.05
    assert rate[between_events][1:-1] == pytest.approx(slope[between_events][1:-1], abs=0.02 * np.abs(rate).max())


@pytest.mark.parametrize("gain", [0.0, 0.05])
def test_a_curve_goes_through_the_rows_and_is_what_denser_rows_show(gain: float) -> None:
    """Also where an input acts on the rate of an output at once, which jumps with it."""
    found = result("three-link")
    actual = replace(found.actual, C=found.actual.C + gain * np.eye(3, 6, 3))
    settings = replace(found.run.simulation.settings(), duration=6.0, record_interval=0.005)
    ways = (replace(settings, record_interval=each) for each in (0.005, 2.5e-4))
    coarse, fine = (simulate(found.actual, found.controller, how) for how in ways)
    there = [replace(found, actual=actual, simulation=replace(run, y=run.x @ actual.C.T)) for run in (coarse, fine)]
    start, end = (float(t) for t in coarse.events.t[-3:-1])
    y, v = curve(there[0], start, end)
    whole = np.isfinite(v).all(axis=1)
    assert (~whole).any() == (gain > 0)  # a gap where the rate jumps
    y, v = y[whole], v[whole]
    late = (fine.t >= start) & (fine.t <= end)
    exact = np.hstack([there[1].simulation.y, output_rate(there[1], fine.x, fine.u)])[late]
    extent = np.ptp(exact, axis=0)
    off = np.abs(np.hstack([y, v])[:, None] - exact)
    # each point of the curve is where a denser row is, which are apart by 1/20 of the rows
    assert (off / extent).max(axis=2).min(axis=1).max() < 0.02
    rows = np.hstack([there[0].simulation.y, output_rate(there[0], coarse.x, coarse.u)])
    for row in rows[(coarse.t >= start) & (coarse.t <= end)]:
        assert (np.hstack([y, v]) == row).all(axis=1).any()


def test_a_curve_of_a_run_that_diverged_is_its_rows() -> None:
    found = result("b0.8")
    run = found.simulation
    x = run.x.copy()
    x[-1] = np.nan
    y, v = curve(replace(found, simulation=replace(run, x=x)), run.t[-5], run.t[-1])
    np.testing.assert_array_equal(y, run.y[-5:])
    np.testing.assert_array_equal(v, output_rate(found, x, run.u)[-5:])


@pytest.mark.parametrize("name", CYCLES)
def test_the_reduced_state_is_that_of_the_error_system(name: str) -> None:
    found = result(name)
    system = error_system(found.actual, found.controller.design)
    s = found.simulation
    X = system.from_original(np.hstack([s.x, s.x_o, s.x_h]))
    np.testing.assert_array_equal(reduce_state(found, s.x, s.x_o, s.x_h), X @ system.T.T)
    np.testing.assert_array_equal(reduce_state(found, s.x[7], s.x_o[7], s.x_h[7]), X[7] @ system.T.T)


@pytest.mark.parametrize("name", CYCLES)
def test_the_critical_mode_is_gamma_at_the_events_of_the_cycle(name: str) -> None:
    """Eq. gamma: χ_k1 = ±γ at the events of the limit cycle, and all other modes vanish there."""
    found = result(name)
    events, gamma = found.simulation.events, found.prediction.gamma
    chi = modes(found, reduce_state(found, events.x, events.x_o, events.x_h))[-4:]
    np.testing.assert_allclose(np.abs(chi[:, 0]), gamma, rtol=1e-6)
    assert np.abs(chi[:, 1:]).max() < 1e-5 * gamma
    assert (np.sign(chi[1:, 0].real * chi[:-1, 0].real) == found.prediction.orbit.sign).all()


@pytest.mark.parametrize("name", CYCLES)
def test_modes_are_multiplied_by_their_eigenvalues_from_event_to_event(name: str) -> None:
    """χ_{i+1} = Λ χ_i (eq. chi_i) when the interval is Δ_crit; a different route from φ through e^{Ā_C Δ}."""
    found = result(name)
    system = error_system(found.actual, found.controller.design)
    x_bar = np.random.default_rng(2).normal(size=system.n + system.n_hat)
    after = (expm(system.A_C * found.prediction.delta_crit) @ system.T_bar @ x_bar)[: len(x_bar)]
    before, then = modes(found, np.array([x_bar, after]))
    assert then[0] == pytest.approx(found.prediction.eigenvalue.real * before[0], rel=1e-6)
