"""Measures of sway: closed forms of known signals, other programs' formulas, and published measures of real people."""

import csv
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from scipy import signal

from icmj import Series, read_series
from icmj.errors import DataError
from icmj.measurement.measures.power_distribution import frequencies
from icmj.measurement.sway import from_torque, measure_sway

RATE = 100.0
T = np.arange(6000) / RATE
FOLDER = "shared/human"  # recordings beside the repository, where there are any


def sinusoid(amplitude=2.0, f=0.5, mean=7.0):
    return mean + amplitude * np.sin(2 * np.pi * f * T)


def one(values, **options):
    return measure_sway(Series(T, values[:, None], ("ap",), ("mm",)), **options).coordinates[0]


def test_a_sinusoid_has_the_measures_of_a_sinusoid():
    found = one(sinusoid())
    assert found.mean == pytest.approx(7)
    assert found.rms == pytest.approx(2 / np.sqrt(2))
    assert found.mean_distance == pytest.approx(4 / np.pi, rel=1e-3)
    assert found.range == pytest.approx(4)
    assert found.speed == pytest.approx(4 * 2 * 0.5, rel=2e-3)
    assert found.rotation_frequency == pytest.approx(0.5 * np.pi / (2 * np.sqrt(2)), rel=3e-3)
    assert found.frequencies.mean == pytest.approx(0.5, rel=1e-3)
    assert found.frequencies.median == pytest.approx(0.5, abs=0.01)
    assert found.unit == "mm"


def test_a_circle_has_the_measures_of_a_circle():
    turn = 2 * np.pi * 0.5 * T
    circle = 3 * np.column_stack([np.cos(turn), np.sin(turn)])
    found = measure_sway(Series(T, circle, ("ap", "ml"), ("mm", "mm"))).plane
    assert found.rms == pytest.approx(3)
    assert found.mean_distance == pytest.approx(3)
    assert found.speed == pytest.approx(2 * np.pi * 3 * 0.5, rel=1e-3)
    assert found.rotation_frequency == pytest.approx(0.5, rel=1e-3)
    assert found.frequencies.mean == pytest.approx(0.5, rel=1e-3)
    assert found.ellipse.axes[0] == pytest.approx(found.ellipse.axes[1])
    assert found.ellipse.area == pytest.approx(np.pi * 5.991464547 * 9 / 2, rel=2e-3)  # each variance is r²/2


def test_only_two_signals_of_one_unit_are_a_plane():
    both = np.column_stack([sinusoid(), sinusoid(f=0.3)])
    assert measure_sway(Series(T, both, ("ap", "ml"), ("mm", "cm"))).plane is None
    assert measure_sway(Series(T, both, ("ap", "ml"))).plane is not None
    assert measure_sway(Series(T, both, ("ap", "ml")), ["ml"]).plane is None


def test_frequencies_of_spectra_known_in_closed_form():
    f = np.linspace(0, 60, 60_001)
    found = frequencies(f, np.exp(-f / 2))
    assert found.mean == pytest.approx(2, rel=1e-5)
    assert found.median == pytest.approx(2 * np.log(2), rel=1e-5)
    assert found.edge == pytest.approx(2 * np.log(20), rel=1e-5)
    assert frequencies(f[1:], f[1:] ** -1.5).slope == pytest.approx(-1.5)
    flat = frequencies(f, np.ones_like(f), (0.15, 5.0))
    assert (flat.mean, flat.median) == pytest.approx(((0.15 + 5) / 2,) * 2)
    assert np.isnan(frequencies(f, 0 * f).mean)
    assert np.isnan(frequencies(f[::1000], np.exp(-f[::1000])).slope)
    with pytest.raises(DataError, match="no two lines"):
        frequencies(f, f, (70, 80))


@pytest.mark.parametrize("seed", range(4))
def test_the_slope_is_that_of_the_lines_which_are_in_its_band_exactly(seed):
    """Durations and rates of which lines fall on 0.1 and 0.7 Hz; of a minute at 100 Hz both do."""
    random, naive = np.random.default_rng(seed), 0
    for _ in range(20):
        rate, duration = int(random.choice([20, 25, 50, 100, 128, 200, 250])), 20 * int(random.integers(1, 6))
        x = np.cumsum(random.standard_normal(rate * duration))
        t = np.arange(len(x)) / rate
        found = measure_sway(Series(t, x[:, None], ("x",), ("m",)))
        length = len(x) // 2
        inside = [k for k in range(length // 2) if Fraction(1, 10) <= Fraction(k * rate, length) <= Fraction(7, 10)]
        assert Fraction(inside[0] * rate, length) == Fraction(1, 10)
        assert Fraction(inside[-1] * rate, length) == Fraction(7, 10)
        f, P = signal.welch(x, rate, "hann", length)
        slope = np.polyfit(np.log(f[inside]), np.log(P[inside]), 1)[0]
        assert found.coordinates[0].frequencies.slope == pytest.approx(slope, rel=1e-6)
        lines = found.spectrum.frequency
        naive += np.sum((lines >= 0.1) & (lines <= 0.7)) != len(inside)
    assert naive > 0


def test_the_low_pass_is_butterworths_run_forth_and_back():
    slow, fast = sinusoid(f=0.5, mean=0), sinusoid(amplitude=1, f=8, mean=0)
    filtered = measure_sway(Series(T, (slow + fast)[:, None], ("ap",)), low_pass=5.0).series["ap"]
    # |H|² of second order, with the bilinear transform's frequencies; 1/√2 at the cut-off
    gain = [1 / (1 + (np.sqrt(2) - 1) * (np.tan(np.pi * f / RATE) / np.tan(np.pi * 5 / RATE)) ** 4) for f in (0.5, 8)]
    middle = slice(500, -500)
    assert filtered[middle] == pytest.approx((gain[0] * slow + gain[1] * fast)[middle], abs=1e-4)


@pytest.mark.parametrize("corner", [1.0, 6.0, 10.0, 30.0, 49.0])
def test_at_its_cut_off_the_gain_of_the_low_pass_is_that_of_any(corner):
    wave = np.sin(2 * np.pi * corner * T + 0.3)
    filtered = measure_sway(Series(T, wave[:, None], ("ap",)), low_pass=corner).series["ap"]
    middle = slice(1000, -1000)
    assert np.sqrt((filtered[middle] ** 2).mean() / (wave[middle] ** 2).mean()) == pytest.approx(2**-0.5, rel=1e-3)


def test_still_signals_have_sizes_and_no_frequencies():
    for value in (3.0, 0.1, 1 / 3, 7.7e7):
        for options in ({}, {"low_pass": 5.0}, {"rate": 37.0}):
            found = one(np.full(6000, value), **options)
            assert (found.rms, found.range, found.speed, found.mean_distance, found.prediction_range) == (0,) * 5
            assert found.mean == pytest.approx(value)
            assert np.isnan([found.rotation_frequency, found.frequencies.mean, found.frequencies.slope]).all()
            assert (found.diffusion.short, found.diffusion.long) == (None, None)
    beside = measure_sway(Series(T, np.column_stack([np.full(6000, 0.1), np.full(6000, 0.2)]), ("ap", "ml"))).plane
    assert beside.ellipse.area == 0
    assert np.isnan([beside.rotation_frequency, beside.frequencies.mean]).all()


@pytest.mark.parametrize("begin", [0.0, 1.7e9 + 0.1, 1.76e9 + 1 / 3])
def test_measures_do_not_depend_on_when_the_clock_began(begin):
    """Seconds from 1970 are rounded to 0.24 microseconds, of which the first two rows made the rate."""
    x = np.cumsum(np.random.default_rng(3).standard_normal(6000))
    known, found = one(x), measure_sway(Series(begin + T, x[:, None], ("ap",), ("mm",))).coordinates[0]
    assert found.frequencies.slope == pytest.approx(known.frequencies.slope, abs=1e-6)
    assert found.frequencies.mean == pytest.approx(known.frequencies.mean, rel=1e-6)
    assert found.speed == pytest.approx(known.speed, rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_a_row_more_or_less_changes_no_measure_by_more_than_its_share(seed):
    """Of sway that is a random walk which returns; a row is 1/6000, and its share some of its own distance more."""
    random = np.random.default_rng(seed)
    x = signal.lfilter([1.0], [1.0, -0.998], random.standard_normal(6011))
    whole = one_of(x[:6000])
    for rows in (*range(5990, 6000), *range(6001, 6011)):
        found = one_of(x[:rows])
        share = abs(rows - 6000) / 6000
        for name, value in found.items():
            scale = 1.0 if name.endswith("slope") else abs(whole[name])
            assert abs(value - whole[name]) < 60 * share * scale, (rows, name, value, whole[name])


def one_of(x):
    """Sizes and frequencies of a record at 100 Hz, but its range, which a row may set."""
    found = measure_sway(Series(np.arange(len(x)) / RATE, x[:, None], ("ap",))).coordinates[0]
    keys = ("rms", "mean_distance", "speed", "frequency.mean", "frequency.edge", "frequency.slope")
    return {key: found.number(key) for key in keys}


def test_uneven_rows_and_other_rates_measure_the_same():
    rng = np.random.default_rng(9)
    shaken = T + rng.uniform(0, 0.005, len(T))
    exact, uneven = (
        one(sinusoid()),
        measure_sway(Series(shaken, np.sin(2 * np.pi * 0.5 * shaken)[:, None] * 2, ("ap",))),
    )
    assert uneven.coordinates[0].rms == pytest.approx(exact.rms, rel=1e-3)
    assert uneven.coordinates[0].speed == pytest.approx(exact.speed, rel=1e-2)
    assert "resampled" in uneven.series.facts
    faster = measure_sway(Series(T, sinusoid()[:, None], ("ap",)), rate=250.0)
    assert faster.rate == pytest.approx(250)
    assert faster.coordinates[0].rms == pytest.approx(exact.rms, rel=1e-3)


def test_the_centre_of_pressure_is_torque_over_weight():
    series = Series(T, np.column_stack([-7.6 * np.ones(6000), T]), ("u.ankle_torque", "u.hip_torque"), ("N m", "N m"))
    found = from_torque(series, "ankle_torque", 760.0)
    assert (found.names, found.units) == (("cop",), ("m",))
    assert found["cop"] == pytest.approx(0.01)
    with pytest.raises(DataError, match="must be positive"):
        from_torque(series, "ankle_torque", 0.0)


@pytest.mark.parametrize(("options", "words"), [
    ({"low_pass": 50.0}, "low-pass of 50 Hz"),
    ({"low_pass": 0.0}, "low-pass of 0 Hz"),
    ({"low_pass": 1e-9}, r"low-pass of 1e-09 Hz; expected from 0\.\d+ Hz, one period in the record"),
    ({"band": (5.0, 1.0)}, "a band of 5 to 1 Hz"),
    ({"columns": ["ml"]}, "no column 'ml'"),
    ({"rate": -1.0}, "must be positive"),
])  # fmt: skip
def test_what_cannot_be_measured_is_refused(options, words):
    with pytest.raises(DataError, match=words):
        measure_sway(Series(T, sinusoid()[:, None], ("ap",)), **options)
    with pytest.raises(DataError, match="expected at least 20"):
        measure_sway(Series(T[:10], sinusoid()[:10, None], ("ap",)))


def test_a_person_has_the_published_measures(root):
    found = measure_sway(read_series(root / "examples" / "standing.csv", rate=100.0)).plane
    assert found.ellipse.area == pytest.approx(0.94469, rel=1e-4)
    assert found.speed == pytest.approx(0.62019, rel=1e-4)
    assert found.frequencies.mean == pytest.approx(0.25658, rel=1e-3)


def test_a_person_is_measured_as_by_formulas_written_out(root):
    series = read_series(root / "examples" / "standing.csv", rate=100.0)
    found = measure_sway(series).coordinates[0]
    x = series["ap"]
    f, P = signal.welch(x, 100.0, "hann", 3000)
    assert found.frequencies.mean == pytest.approx(np.trapezoid(f * P, f) / np.trapezoid(P, f))
    total = np.trapezoid(P, f)
    n = int(np.searchsorted(f, found.frequencies.median))
    assert np.trapezoid(P[:n], f[:n]) < total / 2 < np.trapezoid(P[: n + 1], f[: n + 1])
    assert found.rms == pytest.approx(x.std())
    assert found.speed == pytest.approx(sum(abs(b - a) for a, b in pairwise(x)) / 60)
    lags = np.arange(5, 51)
    msd = [np.mean((x[m:] - x[:-m]) ** 2) for m in lags]
    assert pytest.approx(np.polyfit(np.log(lags), np.log(msd), 1)[0] / 2) == found.diffusion.short.H
    assert pytest.approx(np.polyfit(lags / 100, msd, 1)[0] / 2) == found.diffusion.short.D


def test_fifty_one_recordings_have_the_published_measures(root):
    folder = next((up / FOLDER for up in root.parents if (up / FOLDER / "cop_firm.parquet").is_file()), None)
    if folder is None:
        pytest.skip(f"no {FOLDER} beside the repository: recordings of Santos & Duarte (2016)")
    with open(folder / "sway_trials.csv", newline="", encoding="utf-8") as file:
        published = {row["trial"]: row for row in csv.DictReader(file)}
    series = read_series(folder / "cop_firm.parquet", rate=100.0)
    errors = []
    for trial in sorted({name.rpartition("_")[0] for name in series.names}):
        found, row = measure_sway(series, [f"{trial}_ap", f"{trial}_ml"]).plane, published[trial]
        measured = (found.ellipse.area, found.speed, found.frequencies.mean)
        known = (float(row[key]) for key in ("cop_area_cm2", "cop_speed_cm_s", "cop_mean_freq_hz"))
        errors.append([mine / theirs - 1 for mine, theirs in zip(measured, known, strict=True)])
    assert len(errors) == 51
    area, speed, frequency = np.abs(errors).max(axis=0)
    assert area < 6e-5  # the published have five figures
    assert speed < 1e-4
    assert frequency < 7e-3
    assert np.median(np.abs(errors), axis=0)[2] < 6e-4
