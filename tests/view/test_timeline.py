"""Time as pictures need it: rows at events, the latter part, the sawtooth of the interval, upright resets."""

from dataclasses import replace

import numpy as np
import pytest
from report_cases import result

from icmj.case.motion import event_rows, latter_part, running_interval, with_resets


@pytest.mark.parametrize("name", ["b0.8", "three-link", "exact"])
def test_the_rows_at_events_hold_what_was_before_the_reset(name: str) -> None:
    run = result(name).simulation
    rows = event_rows(run)
    np.testing.assert_array_equal(run.t[rows], run.events.t)
    np.testing.assert_array_equal(run.x_h[rows], run.events.x_h)


def test_the_latter_part_is_the_last_intervals_or_the_last_third() -> None:
    run = result("b0.8").simulation
    assert latter_part(run, 6) == (run.events.t[-7], run.t[-1])
    assert latter_part(run, 10_000)[0] == pytest.approx(40)


def test_time_since_the_last_event_is_a_sawtooth() -> None:
    run = result("b0.8").simulation
    t, since = running_interval(run)
    assert (np.diff(t) >= 0).all()
    np.testing.assert_array_equal(since[1:-1:2], run.events.interval)
    np.testing.assert_array_equal(since[2:-1:2], 0)
    np.testing.assert_allclose(np.diff(since)[::2], np.diff(t)[::2], atol=1e-12)
    assert since[-1] == run.t[-1] - run.events.t[-1]


def test_a_reset_is_drawn_upright() -> None:
    run = result("b0.8").simulation
    t, x_h = with_resets(run, run.x_h, run.events.x_o)
    assert len(t) == len(run.t) + len(run.events)
    for i, at in enumerate(run.events.t):
        pair = np.flatnonzero(t == at)
        np.testing.assert_array_equal(x_h[pair], [run.events.x_h[i], run.events.x_o[i]])
    np.testing.assert_array_equal(np.unique(t), run.t)


def test_without_events_there_is_one_ramp_and_no_reset() -> None:
    run = result("b0.8").simulation
    none = {name: getattr(run.events, name)[:0] for name in ("t", "x", "x_o", "x_h", "y_max", "y_min")}
    quiet = replace(run, events=replace(run.events, **none))
    t, since = running_interval(quiet)
    np.testing.assert_array_equal(t, since)
    np.testing.assert_array_equal(t, [0, run.t[-1]])
    assert with_resets(quiet, run.x_h, quiet.events.x_o)[0] is run.t
    assert len(event_rows(quiet)) == 0
