"""The series for the eye, against the closed loop that they describe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from log_cases import made_up
from scipy.linalg import expm

from icmj.controller.trigger import ClockTrigger
from icmj.log.signals import groups, modes, orbit_at, running_interval, with_resets
from icmj.theory.error_system import error_system

CASES = {
    "+1": ("pendulum", 0.8, 1.807, 40.0),
    "-1": ("pendulum", 1.2, 1.528, 40.0),
    "three-link": ("three_link", 0.9, 0.7594, 20.0),
}


@pytest.mark.parametrize("case", CASES)
def test_the_repeated_orbit_lies_on_the_settled_run(case: str) -> None:
    result, _ = made_up(*CASES[case])
    simulation, orbit = result.simulation, result.prediction.orbit
    assert orbit is not None
    late = simulation.t > 0.7 * simulation.t[-1]
    late &= ~np.isin(simulation.t, simulation.events.t)  # there the run has the value before the jump
    _, y, u = orbit_at(result, orbit, simulation.t[late])
    # a straight line over 1/200 of the orbit, and what is left of the approach
    np.testing.assert_allclose(y, simulation.y[late], atol=5e-3 * np.abs(simulation.y[late]).max())
    np.testing.assert_allclose(u, simulation.u[late], atol=5e-2 * np.abs(simulation.u[late]).max())


@pytest.mark.parametrize("case", CASES)
def test_the_critical_mode_is_gamma_at_settled_events(case: str) -> None:
    """Eq. gamma: χ_k1 = ±γ at the events of the limit cycle, and all other modes vanish there."""
    result, _ = made_up(*CASES[case])
    events, gamma = result.simulation.events, result.prediction.gamma
    chi = modes(result, events.x, events.x_o)[-4:]
    assert gamma is not None
    np.testing.assert_allclose(np.abs(chi[:, 0]), gamma, rtol=1e-3)
    assert np.abs(chi[:, 1:]).max() < 1e-2 * gamma
    assert (np.sign(chi[1:, 0] * chi[:-1, 0]) == result.prediction.orbit.sign).all()


def test_modes_are_multiplied_by_their_eigenvalues_from_event_to_event() -> None:
    """χ_{i+1} = Λ χ_i (eq. chi_i) when the interval is Δ_crit; a different route from φ through e^{Ā_C Δ}."""
    result, _ = made_up(*CASES["+1"])
    system = error_system(result.actual, result.controller.design)
    x_bar = np.random.default_rng(2).normal(size=system.n + system.n_hat)
    after = (expm(system.A_C * result.prediction.delta_crit) @ system.T_bar @ x_bar)[: system.n + system.n_hat]
    rows = [system.to_original(np.concatenate([v, np.zeros(system.n_hat)])) for v in (x_bar, after)]
    before, then = modes(result, np.array(rows)[:, :2], np.array(rows)[:, 2:4])
    assert then[0] == pytest.approx(result.prediction.eigenvalue.real * before[0], rel=1e-9)


def test_time_since_the_last_sample_is_a_sawtooth() -> None:
    result, _ = made_up(*CASES["+1"])
    events = result.simulation.events
    t, since = running_interval(result.simulation)
    assert (np.diff(t) >= 0).all()
    np.testing.assert_array_equal(since[1:-1:2], events.interval)
    np.testing.assert_array_equal(since[2:-1:2], 0)
    np.testing.assert_allclose(np.diff(since)[::2], np.diff(t)[::2], atol=1e-12)
    assert since[-1] == result.simulation.t[-1] - events.t[-1]


def test_a_reset_is_drawn_upright() -> None:
    result, _ = made_up(*CASES["+1"])
    simulation, events = result.simulation, result.simulation.events
    t, x_h = with_resets(simulation, simulation.x_h, events.x_o)
    assert len(t) == len(simulation.t) + len(events)
    for i, at in enumerate(events.t):
        pair = np.flatnonzero(t == at)
        np.testing.assert_array_equal(x_h[pair], [events.x_h[i], events.x_o[i]])
    np.testing.assert_array_equal(np.unique(t), simulation.t)


def test_series_are_left_out_where_they_do_not_exist() -> None:
    result, _ = made_up(*CASES["+1"])
    everything = {group.path for group in groups(result)}
    nothing = dict.fromkeys(("delta_crit", "eigenvalue", "period", "gamma", "amplitude", "orbit", "V_inv"))
    none = replace(result, prediction=replace(result.prediction, cycle=False, **nothing))
    gone = {"outputs/predicted", "inputs/predicted", "interval/delta_crit"}
    gone |= {"modes/critical", "modes/others", "modes/gamma", "modes/events"}
    assert everything - {group.path for group in groups(none)} == gone
    clock = replace(
        result,
        controller=result.controller.triggered_by(ClockTrigger(0.5)),
        simulation=replace(result.simulation, control="clock", E=np.full_like(result.simulation.E, np.nan)),
    )
    assert everything - {g.path for g in groups(clock)} == {"trigger/E", "trigger/threshold", "trigger/events"}


def test_every_series_has_a_name_and_a_colour() -> None:
    result, _ = made_up(*CASES["three-link"])
    for group in groups(result):
        assert len(group.t) == len(group.values), group.path
        assert group.values.shape[1] == len(group.names) == len(group.colours), group.path
        assert (np.diff(group.t) >= 0).all(), group.path
