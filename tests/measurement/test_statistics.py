"""Statistics of runs under noise: their confidence covers the truth, and uneven rows do not show in a spectrum."""

import numpy as np
import pytest
from linear_cases import PENDULUM, event_controller, pendulum_design, settings
from scipy.signal import lfilter, welch

from icmj import Noise, measure
from icmj.linear.run import simulate
from icmj.measurement.measures.power_distribution import frequencies
from icmj.measurement.statistics import (
    Estimate,
    Statistics,
    cut_windows,
    deviation,
    hann,
    mean,
    spectrum,
    statistics,
)
from icmj.series.even_rows import resample
from icmj.simulation.ending import Outcome
from icmj.simulation.simulation import Events, Simulation

PHI = 0.9


def autoregressive(runs: int, length: int, seed: int = 0) -> np.ndarray:
    """Sequences y_i = φ y_{i−1} + ξ_i in their stationary state, shape (runs, length)."""
    white = np.random.default_rng(seed).standard_normal((runs, length + 500))
    return np.asarray(lfilter([1.0], [1.0, -PHI], white, axis=1)[:, 500:])


def covered(found: list[Estimate], truth: float) -> float:
    return float(np.mean([abs(estimate.value - truth) <= estimate.error for estimate in found]))


def test_block_confidence_covers_the_truth_of_a_correlated_sequence() -> None:
    sequences = autoregressive(1000, 4000)
    assert 0.93 <= covered([mean(y) for y in sequences], 0.0) <= 0.97
    assert 0.93 <= covered([deviation(y) for y in sequences], 1 / np.sqrt(1 - PHI**2)) <= 0.97
    # taken for independent, successive values would claim far too much
    naive = [Estimate(float(y.mean()), 1.96 * y.std() / np.sqrt(len(y))) for y in sequences]
    assert covered(naive, 0.0) < 0.5


def test_too_short_a_sequence_has_no_confidence() -> None:
    assert np.isnan(mean(np.array([1.0, 2.0])).error)
    assert mean(np.array([1.0, 2.0])).value == 1.5
    assert deviation(np.ones(40)) == Estimate(0.0, 0.0)
    assert np.isfinite(mean(np.arange(4.0)).error)


def test_spectrum_is_welch_s_and_its_confidence_covers_the_known_one() -> None:
    t = np.arange(8000) * 0.01
    inside = []
    for y in autoregressive(40, 8000, seed=1):
        found = spectrum(t, y[:, None], segments=16)
        frequency, power = welch(y, 100.0, "hann", 500, detrend="constant")
        np.testing.assert_allclose(found.frequency, frequency, atol=1e-9)
        np.testing.assert_allclose(found.power[:, 0], power, rtol=1e-6)
        known = 2 * 0.01 / np.abs(1 - PHI * np.exp(-2j * np.pi * frequency * 0.01)) ** 2
        mid = slice(3, -3)  # at the ends the truth is less: lines without a partner, and what the mean took
        inside.append((found.low[mid, 0] <= known[mid]) & (known[mid] <= found.high[mid, 0]))
    assert 0.93 <= np.mean(inside) <= 0.97


@pytest.mark.slow
@pytest.mark.parametrize(("length", "segments"), [(4000, 4), (4002, 4), (5998, 2), (4001, 4), (6000, 16)])
def test_the_confidence_of_every_line_covers_what_is_expected_there(length: int, segments: int) -> None:
    """White noise, of which the expected power of a line is that of its window, without the part that the mean took."""
    runs = np.random.default_rng(length).standard_normal((length, 2000))
    found = spectrum(0.01 * np.arange(length), runs, segments)
    n = len(found.frequency)
    size = length // segments
    assert n == size // 2 + 1
    window = hann(size)
    waves = window * np.exp(-2j * np.pi * np.outer([0, 1, 2, n // 2, n - 1], np.arange(size)) / size)
    waves -= waves.mean(axis=1, keepdims=True)  # to subtract the mean of the noise is to subtract that of the wave
    power = (np.abs(waves) ** 2).sum(axis=1) * 0.01 / (window**2).sum()
    power[1:] *= 2
    if size % 2 == 0:
        power[-1] /= 2
    for line, expected in zip((0, 1, 2, n // 2, n - 1), power, strict=True):
        inside = np.mean((found.low[line] <= expected) & (expected <= found.high[line]))
        assert inside == pytest.approx(0.95, abs=0.02), (line, inside)
        assert found.power[line].mean() == pytest.approx(expected, rel=0.08)


@pytest.mark.parametrize("length", range(40, 56))
@pytest.mark.parametrize("size", [7, 10, 12, 19, 20, 40])
def test_no_row_is_left_out_of_any_windows(length: int, size: int) -> None:
    """A unit at any row is seen, by the mean of a window at least; windows overlap by half but for half a row."""
    parts = cut_windows(np.eye(length), size)
    assert (parts**2).sum(axis=(0, 1)).min() > 0
    assert len(parts) >= 2 * length / (size + 1) - 1


def test_a_row_more_changes_a_spectrum_by_its_share() -> None:
    """Of random walks, whatever the remainder of their rows by four; up to 128 % where a quarter was left out."""
    for seed in range(20):
        x = np.cumsum(np.random.default_rng(seed).standard_normal(6004))
        for length in range(5998, 6004):
            mean = [frequencies(*_line_power(x[:rows])).mean for rows in (length, length + 1)]
            assert mean[1] == pytest.approx(mean[0], rel=0.02)


def _line_power(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    found = spectrum(0.01 * np.arange(len(x)), x[:, None], 2)
    return found.frequency, found.power[:, 0]


def test_a_constant_has_no_power_whatever_its_value() -> None:
    for value in (0.1, 1 / 3, 7e7, -2.3e-9):
        found = spectrum(0.01 * np.arange(1000), np.full((1000, 1), value))
        assert not found.power.any()
        shaken = value * (1 + 2e-16 * np.arange(1000) % 2)
        assert not spectrum(0.01 * np.arange(1000), shaken[:, None]).power.any()


def test_uneven_rows_do_not_show() -> None:
    random = np.random.default_rng(0)
    even = np.arange(6001) * 0.01
    events = np.sort(random.uniform(0, 60, 150))
    events[::3] = even[np.searchsorted(even, events[::3])] + 1e-11  # an event just after a row
    t = np.unique(np.concatenate([even, events]))

    def signal(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.sin(2 * np.pi * 0.7 * t), np.cos(2 * np.pi * 3.1 * t + 1)])

    times, values = resample(t, signal(t))
    assert len(times) == 6001
    np.testing.assert_allclose(values, signal(times), atol=2e-5)
    assert np.abs(values - signal(times))[100:-100].max() < 1e-6  # but for the spline's ends
    known = spectrum(even, signal(even))
    found = spectrum(t, signal(t))
    np.testing.assert_allclose(found.power, known.power, rtol=1e-3, atol=1e-8 * known.power.max())


def hand_made(intervals: np.ndarray, least: float) -> Simulation:
    t = np.arange(0, intervals.sum(), 0.01)
    y = np.column_stack([np.sin(t), 0.3 + np.cos(t)])
    at, K = np.cumsum(intervals), len(intervals)
    states, extremes = np.zeros((K, 2)), np.zeros((K, 2))
    none = np.zeros((len(t), 2))
    return Simulation(
        "linear", "event", t, none, y, none, none, none, np.zeros(len(t)),
        Events(at, states, states, states, extremes, extremes), Outcome("completed", float(t[-1]), "ran"),
        least=least, noisy=True,
    )  # fmt: skip


def test_numbers_of_a_run_known_by_construction() -> None:
    random = np.random.default_rng(2)
    intervals = np.maximum(random.normal(0.4, 0.2, 2000), 0.3)
    told = statistics(hand_made(intervals, 0.3))
    assert isinstance(told, Statistics)
    counted = intervals[np.cumsum(intervals) >= 0.1 * intervals.sum()]
    assert told.events == pytest.approx(len(counted), abs=1)
    assert told.interval is not None
    assert told.interval_deviation is not None
    assert told.binding is not None
    assert told.interval.value == pytest.approx(counted.mean(), rel=1e-3)
    assert told.interval_deviation.value == pytest.approx(counted.std(), rel=1e-3)
    assert told.binding.value == pytest.approx(np.mean(counted == 0.3), abs=2e-3)
    assert told.counts.sum() == told.events
    assert told.edges[0] == pytest.approx(0.3)
    assert [rms.value for rms in told.rms] == pytest.approx([np.sqrt(0.5)] * 2, rel=0.01)
    assert told.mean[1].value == pytest.approx(0.3, abs=0.01)
    assert "at the least of 0.3 s in" in told.words


@pytest.mark.parametrize("K", range(2, 13))
def test_intervals_that_are_equal_but_for_rounding_have_statistics(K: int) -> None:
    for interval in np.random.default_rng(K).integers(1, 900, 20) / 1000:
        told = statistics(hand_made(np.full(K, interval), 0.0))
        if told is not None and told.interval is not None:
            assert told.counts.sum() == told.events
            assert told.interval.value == pytest.approx(interval)


def test_a_noisy_run_is_told_by_its_statistics() -> None:
    noise = Noise(input="torque", size=0.02, corner=0.5, seed=1)
    plant, controller = PENDULUM.scaled(0.8), event_controller(pendulum_design(), delta_min=0.25)
    run = simulate(plant, controller, settings(60.0, disturbance=(noise,)))
    told, motion = statistics(run), measure(run, T_hat=np.eye(2))
    assert told is not None
    assert told.interval is not None
    assert run.noisy
    assert run.least == 0.25
    assert (motion.kind, motion.p, motion.interval) == ("noisy", None, told.interval.value)
    assert motion.words == told.words
    quiet = measure(simulate(plant, controller, settings(60.0), x0=[0.01, 0]), T_hat=np.eye(2))
    assert quiet.kind != "noisy"


def test_a_run_that_fell_or_hardly_began_has_none() -> None:
    run = hand_made(np.full(50, 0.4), 0.3)
    assert statistics(Simulation(**{**vars(run), "outcome": Outcome("fell", 1.0, "fell")})) is None
    assert statistics(hand_made(np.full(1, 0.1), 0.0)) is None
    events = hand_made(np.full(1, 20.0), 0.0).events
    alone = statistics(Simulation(**{**vars(run), "control": "continuous", "events": events}))
    assert alone is not None
    assert alone.interval is None
    assert alone.binding is None
    assert alone.words.startswith("Driven by noise: RMS of the outputs")
