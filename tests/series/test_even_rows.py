"""Rows at even times are taken as they are."""

from dataclasses import replace

import numpy as np
import pytest

import icmj
from icmj.series.even_rows import resample, resample_series
from icmj.series.series import Series


def test_even_rows_are_not_interpolated(monkeypatch):
    """A spline through their own times took most of the time that measures of sway took."""

    def refuse(*_):
        raise AssertionError("a spline through rows that are even")

    monkeypatch.setattr("scipy.interpolate.CubicSpline", refuse)
    t, values = 0.01 * np.arange(6001), np.random.default_rng(0).standard_normal((6001, 2))
    even, smooth = resample(t, values)
    np.testing.assert_allclose(even, t, atol=1e-12)
    np.testing.assert_array_equal(smooth, values)


def test_rows_that_crowd_in_one_place_do_not_set_the_step():
    t = np.sort(np.concatenate([np.linspace(0, 2, 41), 1 + 1e-12 * np.arange(1, 200)]))
    even, values = resample(t, np.sin(t)[:, None])  # at the usual distance, 2e12 rows
    assert len(even) <= 10 * len(t) + 1
    np.testing.assert_allclose(values[:, 0], np.sin(even), atol=1e-6)  # of a cubic spline at 0.05 s: 0.05⁴ · 5/384


@pytest.mark.parametrize("tenths", range(10))
def test_no_row_is_lost_to_the_rounding_of_times(tenths):
    """A minute at 100 Hz has 3001 rows at 50 Hz, and 5501 rows from its fifth second on, wherever its clock begins."""
    for begin in (0.1 * tenths, 1.7e9 + 0.1 * tenths):  # seconds from 1970 are rounded to 0.24 microseconds
        t = begin + np.arange(6001) / 100
        series = Series(t, np.sin(np.arange(6001.0) / 100)[:, None], ("ap",))
        assert len(resample_series(series, 50.0)) == 3001
        assert len(series.since(begin + 5)) == 5501
    added = Series(np.concatenate([[0.0], np.cumsum(np.full(6000, 0.01))]), np.zeros((6001, 1)), ("ap",))
    assert [len(added.since(s)) for s in range(0, 60, 5)] == [6001 - 100 * s for s in range(0, 60, 5)]


@pytest.mark.parametrize(("digits", "rate"), [(2, 15.0), (3, 60.0), (3, 120.0), (3, 240.0)])
def test_times_that_are_written_with_few_digits_have_their_mean_rate(digits, rate):
    """Steps of 8 and 9 ms, most of 8, are 120 Hz; the rounding of first and last leaves it uncertain."""
    t = np.round(np.arange(3601) / rate, digits)
    found = resample_series(Series(t, np.sin(t)[:, None], ("ap",)))
    assert (len(found) - 1) / (found.t[-1] - found.t[0]) == pytest.approx(rate, rel=10**-digits / t[-1])
    assert len(found) == 3601
    lost = np.delete(np.arange(3601), 7) / rate  # their usual distance, and not the mean one, is the rate
    found = resample_series(Series(lost, np.sin(lost)[:, None], ("ap",)))
    assert found.t[1] - found.t[0] == pytest.approx(1 / rate)
    assert len(found) == 3601


def test_a_run_that_was_exported_is_measured_between_its_events():
    """A command that jumps at events, as its column of events says, whichever signals are taken of it."""
    jumps = np.array([0.5037, 1.2071])

    def command(t):
        return np.cos(3 * t) + 5 * np.searchsorted(jumps, t)

    t = np.union1d(np.arange(0, 2.005, 0.01), jumps)
    values = np.column_stack([command(t), np.searchsorted(jumps, t)])
    series = Series(t, values, ("u.torque", "interval"))
    np.testing.assert_array_equal(series.jumps, jumps)
    one = series.chosen(["torque"])
    np.testing.assert_array_equal(one.jumps, jumps)
    even = resample_series(one, 331.0)
    assert even["torque"] == pytest.approx(command(even.t), abs=1e-7)
    blind = resample_series(replace(one, jumps=np.zeros(0)), 331.0)
    assert np.abs(blind["torque"] - command(blind.t)).max() > 1
    # a count that has a unit, falls, or numbers the rows is no count of events
    for column, unit in ((values[:, 1], "s"), (values[::-1, 1], ""), (np.arange(len(t)), "")):
        assert len(Series(t, np.column_stack([values[:, 0], column]), ("u", "interval"), ("", unit)).jumps) == 0


def test_what_a_lower_rate_cannot_show_is_filtered_out_before():
    """0.5 mm of hum at 97 Hz in rows of 1000 Hz became 3 Hz at 100 Hz, and made the mean speed 2.18 times as large."""
    t = np.arange(60_000) / 1000
    slow = 5.0 * np.sin(2 * np.pi * 0.4 * t)
    hum = 0.5 * np.sin(2 * np.pi * 97 * t)
    series = icmj.Series(t, np.column_stack([slow, slow + hum]), ("clean", "cop"), ("mm", "mm"))
    clean, cop = icmj.measure_sway(series, rate=100.0).coordinates
    # 4 · amplitude · frequency; at both ends the filter meets a hum that begins and ends there
    assert clean.speed == pytest.approx(4 * 5.0 * 0.4, rel=1e-3)
    assert cop.speed == pytest.approx(clean.speed, rel=0.01)
    even = resample_series(series, 100.0)
    assert even.remarks == ("resampled by a cubic spline at 100 Hz, below 40 Hz",)
    # at 0.4 of the new rate each run of the filter lets 1/√2 pass
    corner = icmj.Series(t, np.sin(2 * np.pi * 40 * t)[:, None], ("a",))
    inner = resample_series(corner, 101.0).since(5).until(55).values[:, 0]
    warped = np.tan(np.pi * 0.04) / np.tan(np.pi * 0.0404)
    assert inner.std() * np.sqrt(2) == pytest.approx(1 / (1 + warped**8), rel=0.01)


def test_a_higher_rate_and_the_jumps_of_a_run_are_not_filtered():
    t = np.arange(300) / 100
    values = np.sin(2 * np.pi * 20 * t)[:, None]
    assert "below" not in resample_series(icmj.Series(t, values, ("a",)), 200.0).facts["resampled"]
    counts = np.column_stack([values[:, 0], np.floor(t)])
    run = icmj.Series(t, counts, ("y.a", "interval"), ("rad", ""))
    assert "below" not in resample_series(run, 50.0).facts["resampled"]
