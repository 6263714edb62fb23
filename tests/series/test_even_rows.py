"""Rows at even times are taken as they are."""

import numpy as np

from icmj.series.even import evenly


def test_even_rows_are_not_interpolated(monkeypatch):
    """A spline through their own times took most of the time that measures of sway took."""

    def refuse(*_):
        raise AssertionError("a spline through rows that are even")

    monkeypatch.setattr("scipy.interpolate.CubicSpline", refuse)
    t, values = 0.01 * np.arange(6001), np.random.default_rng(0).standard_normal((6001, 2))
    even, smooth = evenly(t, values)
    np.testing.assert_allclose(even, t, atol=1e-12)
    np.testing.assert_array_equal(smooth, values)


def test_rows_that_crowd_in_one_place_do_not_set_the_step():
    t = np.sort(np.concatenate([np.linspace(0, 2, 41), 1 + 1e-12 * np.arange(1, 200)]))
    even, values = evenly(t, np.sin(t)[:, None])  # at the usual distance, 2e12 rows
    assert len(even) <= 10 * len(t) + 1
    np.testing.assert_allclose(values[:, 0], np.sin(even), atol=1e-6)  # of a cubic spline at 0.05 s: 0.05⁴ · 5/384
