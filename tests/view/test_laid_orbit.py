"""The predicted orbit laid on runs: on a run that is on it the two are the same, in any phase and with either sign."""

from dataclasses import replace

import numpy as np
import pytest
from report_cases import BY_LETTER, result

from icmj import Settings, error_system
from icmj.case.laid_orbit import lay_orbit
from icmj.case.motion import event_rows, output_rate, reduce_state
from icmj.case.result import Result
from icmj.linear.run import simulate
from icmj.log.groups import list_groups
from icmj.report.case_runs import pair

CYCLES = ["b0.8", "b1.2", "three-link", "neglected"]  # b1.2 is mirrored; neglected has n = 4, n̂ = 2


def on_the_orbit(name: str, sign: int = 1, point: int = 0, intervals: float = 4.5) -> Result:
    """A case whose run starts on the predicted orbit, or on its mirror image, at the time ``orbit.t[point]`` of it.

    Rows are the points at which the theory gives the orbit, so that nothing is interpolated.
    """
    found = result(name)
    orbit = found.prediction.orbit
    steps = int(intervals * len(orbit.t))
    system = error_system(found.actual, found.controller.design)
    x, x_o, x_h = np.split(sign * system.to_original(orbit.X[point]), np.cumsum([system.n, system.n_hat]))
    settings = Settings(duration=steps * orbit.t[1], record_interval=orbit.t[1], limit=1e6)
    run = simulate(found.actual, found.controller, settings, x0=x, x_o0=x_o, x_h0=x_h)
    return replace(found, simulation=run)


@pytest.mark.parametrize("point", [0, 100], ids=["from an event", "from between events"])
@pytest.mark.parametrize("sign", [1, -1], ids=["one image", "the other"])
@pytest.mark.parametrize("name", CYCLES)
def test_laid_on_a_run_on_the_predicted_cycle_it_is_the_run(name: str, sign: int, point: int) -> None:
    found = on_the_orbit(name, sign, point)
    run, laid = found.simulation, lay_orbit(found)
    assert len(run.events) == 4
    between = np.ones(len(run.t), dtype=bool)
    between[[0, *event_rows(run)]] = False  # at an event, which t = 0 is, inputs and rates jump
    rate = output_rate(found, run.x, run.u)
    for signal, values, at in (
        (laid.orbit.y, run.y, slice(None)),
        (laid.reduced, reduce_state(found, run.x, run.x_o, run.x_h), slice(None)),
        (laid.orbit.u, run.u, between),
        (laid.rate, rate, between),
    ):
        np.testing.assert_allclose(laid.at(run.t[at], signal), values[at], atol=1e-7 * np.abs(values).max())


@pytest.mark.parametrize("name", CYCLES)
def test_it_repeats_with_its_period_and_each_interval_has_the_sign_of_its_eigenvalue(name: str) -> None:
    laid = lay_orbit(on_the_orbit(name))
    orbit = laid.orbit
    t = laid.start + np.linspace(-2.3, 1.4, 101) * orbit.delta
    for signal in (orbit.y, laid.reduced):
        now = laid.at(t, signal)
        np.testing.assert_allclose(laid.at(t + orbit.delta, signal), orbit.sign * now, atol=1e-9)
        np.testing.assert_allclose(laid.at(t + orbit.period, signal), now, atol=1e-9)


@pytest.mark.parametrize("name", CYCLES)
def test_one_period_is_a_closed_curve_that_starts_at_the_last_event(name: str) -> None:
    found = on_the_orbit(name, -1)
    laid = lay_orbit(found)
    whole = laid.whole(laid.reduced)
    assert len(whole) == round(laid.orbit.period / laid.orbit.delta) * len(laid.orbit.t)
    last = reduce_state(found, *(getattr(found.simulation.events, name)[-1] for name in ("x", "x_o", "x_h")))
    np.testing.assert_allclose(whole[[0, -1]], [last, last], atol=1e-7 * np.abs(whole).max())


def test_its_own_times_are_those_of_the_theory_within_the_bounds() -> None:
    laid = lay_orbit(on_the_orbit("b1.2"))
    begin, end = laid.start - 2.5 * laid.orbit.delta, laid.start + 0.5 * laid.orbit.delta
    t = laid.times(begin, end)
    step = laid.orbit.t[1]
    assert begin <= t[0] < begin + step
    assert end - step < t[-1] <= end
    np.testing.assert_allclose(np.diff(t), step, rtol=1e-9)
    assert laid.start in t
    assert laid.times(1.0, 1.0 - 1e-9).shape == (0,)


def off_the_cycle(x_part: float, observer_part: float) -> Result:
    """b = 0.8 with x̄ at the last event made of the orbit's, plant and observer part each times a factor."""
    found = on_the_orbit("b0.8")
    events, orbit = found.simulation.events, found.prediction.orbit
    x = x_part * orbit.x_bar[: found.actual.n]
    x_o = x + observer_part * orbit.x_bar[found.actual.n :]  # T̂ is the identity here
    moved = replace(events, x=np.vstack([events.x[:-1], x]), x_o=np.vstack([events.x_o[:-1], x_o]))
    return replace(found, simulation=replace(found.simulation, events=moved))


@pytest.mark.parametrize(("x_part", "observer_part"), [(1, 1), (-0.1, 200), (0.1, -200), (2, -0.1), (-2, 0.1)])
def test_off_the_cycle_the_nearer_image_is_taken(x_part: float, observer_part: float) -> None:
    found = off_the_cycle(x_part, observer_part)
    orbit, events = found.prediction.orbit, found.simulation.events
    x_bar = np.concatenate([events.x[-1], events.x_o[-1] - events.x[-1]])
    distance = {sign: np.linalg.norm(x_bar - sign * orbit.x_bar) for sign in (1, -1)}
    assert lay_orbit(found).side == min(distance, key=distance.get)
    if abs(observer_part) == 200:  # the plant's state alone would point to the other
        assert lay_orbit(found).side != np.sign(events.x[-1] @ orbit.x_bar[: found.actual.n])


@pytest.mark.parametrize(("x_part", "observer_part"), [(1, 1), (-1, -1), (-0.1, 200), (0.1, -200)])
def test_viewer_and_report_lay_it_alike(x_part: float, observer_part: float) -> None:
    """Also where plant and observer part of x̄ point to different images."""
    found = off_the_cycle(x_part, observer_part)
    start = found.simulation.events.t[-1]
    series = next(group for group in list_groups(found) if group.path == "outputs/predicted")
    in_viewer = series.values[np.searchsorted(series.t, start), 0]
    axes = BY_LETTER["d"].draw(pair([found])[0]).axes[0]
    curve = next(line for line in axes.get_lines() if line.get_label() == "predicted")
    assert np.deg2rad(curve.get_xdata()[0]) == pytest.approx(in_viewer, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_without_events_it_is_laid_on_the_start_which_is_one(sign: int) -> None:
    found = on_the_orbit("b1.2", sign, intervals=0.9)
    assert len(found.simulation.events) == 0
    laid = lay_orbit(found)
    assert (laid.start, laid.side) == (0.0, sign)
    run = found.simulation
    np.testing.assert_allclose(laid.at(run.t, laid.orbit.y), run.y, atol=1e-7 * np.abs(run.y).max())


def test_an_orbit_without_a_predicted_cycle_or_on_a_state_that_is_not_a_number_is_laid_too() -> None:
    assert lay_orbit(result("exact")) is None
    found = result("b1.7")
    assert not found.prediction.cycle
    assert lay_orbit(found).orbit is found.prediction.orbit
    laid = lay_orbit(off_the_cycle(np.nan, 1))
    assert laid.side == 1
    assert np.isfinite(laid.at(np.linspace(0, 5, 7), laid.orbit.y)).all()
