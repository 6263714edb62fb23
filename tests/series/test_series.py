"""Series: names, choices, even times, pandas."""

import builtins
import sys

import numpy as np
import pytest

from icmj.errors import DataError
from icmj.series.even_rows import resample_series
from icmj.series.series import Series

T = np.arange(0, 2, 0.01)


def waves(t=T):
    return Series(t, np.column_stack([np.sin(t), np.cos(t)]), ("x.ankle", "u.ankle"), ("rad", "N m"))


def test_a_signal_is_found_by_its_name_or_the_end_of_it():
    series = Series(T, np.column_stack([T, 2 * T, 3 * T]), ("x.ankle", "u.ankle", "y.shank"))
    assert series["y.shank"] is not None
    assert series["shank"] == pytest.approx(3 * T)
    assert series.chosen(["shank", "x.ankle"]).names == ("y.shank", "x.ankle")
    with pytest.raises(DataError, match=r"'ankle' could be x\.ankle or u\.ankle"):
        series.place("ankle")
    with pytest.raises(DataError, match=r"no column 'hip'; expected one of x\.ankle, u\.ankle, y\.shank"):
        series.place("hip")


@pytest.mark.parametrize(("t", "values", "names", "words"), [
    ([0, 1], [[1], [2]], ("a", "b"), "do not fit"),
    ([0, 1], [[1, 1], [2, 2]], ("a", "a"), "several signals are called a"),
    ([0, 1, 1], [[1]] * 3, ("a",), "do not rise at row 3: 1 s after 1 s"),
    ([0, np.nan, 1], [[1]] * 3, ("a",), "do not rise at row 2"),
    ([np.inf], [[1]], ("a",), "do not rise at row 1"),
])  # fmt: skip
def test_what_is_no_series_is_refused(t, values, names, words):
    with pytest.raises(DataError, match=words):
        Series(np.array(t, float), np.array(values, float), names)


def test_even_times_are_left_as_they_are():
    rounded = waves(np.round(T + 1e-6 * np.sin(1000 * T), 6))
    even = resample_series(rounded)
    assert "resampled" not in even.facts
    np.testing.assert_array_equal(even.values, rounded.values)
    assert np.ptp(np.diff(even.t)) < 1e-12


def test_uneven_times_are_made_even_by_a_spline_and_said_so():
    rng = np.random.default_rng(2)
    shaken = waves(np.sort(T + rng.uniform(0, 0.004, len(T))))
    even = resample_series(shaken)
    assert even.facts["resampled"].startswith("cubic spline at")
    assert even["x.ankle"] == pytest.approx(np.sin(even.t), abs=1e-7)
    fine = resample_series(waves(), 333.0)
    assert 1 / (fine.t[1] - fine.t[0]) == pytest.approx(333)
    assert fine["u.ankle"] == pytest.approx(np.cos(fine.t), abs=1e-7)


@pytest.mark.parametrize(("spoil", "rate", "words"), [
    (lambda s: s.since(5), None, "0 rows; expected at least 2"),
    (lambda s: Series(s.t, np.where(s.t[:, None] == s.t[7], np.nan, s.values), s.names), None, "first at 0.07 s"),
    (lambda s: Series(np.delete(s.t, slice(20, 30)), np.delete(s.values, slice(20, 30), 0), s.names), None, "gap of"),
    (
        lambda s: Series(s.t, s.values * 1e60, s.names),
        None,
        r"x\.ankle: has a value of 1e\+60; expected at most 1e\+50",
    ),
    (lambda s: Series(s.t * 1e299, s.values, s.names), None, "1e.297 s apart; are the times in seconds"),
    (lambda s: Series(s.t * 1e-299, s.values, s.names), None, "1e-301 s apart; are the times in seconds"),
    (lambda s: s, -1.0, "must be positive"),
    (lambda s: s, 1e12, "expected at most"),
])  # fmt: skip
def test_what_cannot_be_made_even_is_refused(spoil, rate, words):
    with pytest.raises(DataError, match=words):
        resample_series(spoil(waves()), rate)


def test_pandas_gets_times_names_and_units():
    pandas = pytest.importorskip("pandas")
    frame = waves().to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == ["x.ankle", "u.ankle"]
    assert frame.index.name == "t"
    assert frame.attrs["units"] == {"t": "s", "x.ankle": "rad", "u.ankle": "N m"}
    assert frame["u.ankle"].to_numpy() == pytest.approx(np.cos(T))


def test_without_pandas_one_line_says_so(monkeypatch):
    load = builtins.__import__

    def no_pandas(name, *rest, **more):
        if name == "pandas":
            raise ImportError(name)
        return load(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", no_pandas)
    with pytest.raises(DataError, match="pandas is not installed; `pip install pandas`"):
        waves().to_pandas()


def test_xarray_gets_signals_by_kind_with_names_and_units_as_coordinates():
    xarray = pytest.importorskip("xarray")
    values = np.column_stack([np.sin(T), np.cos(T), T, 2 * T, 3 * T])
    names = ("x.ankle", "x.ankle_rate", "u.ankle", "E", "C7.x")
    series = Series(T, values, names, ("rad", "rad/s", "N m", "", "mm"), {"case": "mine"})
    found = series.to_xarray()
    assert isinstance(found, xarray.Dataset)
    assert found["x"].dims == ("t", "state")
    np.testing.assert_array_equal(found["x"].sel(state="ankle_rate"), np.cos(T))
    assert found["x_units"].sel(state="ankle_rate").item() == "rad/s"
    assert found["u"].attrs["units"] == "N m"
    assert "units" not in found["x"].attrs
    assert found["t"].attrs["units"] == "s"
    assert found["E"].dims == found["C7.x"].dims == ("t",)
    assert found["C7.x"].attrs["units"] == "mm"
    assert found.attrs == {"case": "mine"}
    assert set(Series(T, values[:, :2], ("t", "state")).to_xarray().data_vars) == {"t_signal", "state_signal"}
    assert float(found["E"].interp(t=0.5 * (T[0] + T[1]))) == pytest.approx(T[0] + T[1])


def test_without_xarray_one_line_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(DataError, match="xarray is not installed; `pip install xarray`"):
        waves().to_xarray()
