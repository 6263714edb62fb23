"""Statistics of a run under noise, which has no exact period: averages with their errors, spectra, and modality.

Successive values of a motion are not independent, so their scatter says little about the error of their mean. Averages
over blocks much longer than the motion's memory are nearly independent, and theirs does (batch means). Spectra are of
rows that are not evenly spaced, because events are recorded when they come.

Whether a distribution has several modes is asked of Silverman's critical bandwidth. A Gaussian kernel of width h
smooths a sample; the wider it is, the fewer modes are left. The *critical bandwidth* is the least width with a single
one: large relative to the standard deviation where there are two clusters (Silverman 1981, J. R. Stat. Soc. B
43:97–99). Independent values are compared with samples of the smoothed distribution itself, which has one mode, as
Silverman does. Values of a signal are not independent: a slow signal of one mode also stays near some values for long.
They are compared with signals of the same spectrum and random phases, which are Gaussian (Theiler et al. 1992, Physica
D 58:77–94). The test is conservative where the single mode is peaked, and not where it is flat, so that only a very
small p indicates several modes. The outermost 5 % of the values are left out: bumps of a tail are no modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array, find_range, is_between
from icmj.errors import DataError
from icmj.series.even_rows import resample
from icmj.simulation.simulation import Simulation

SEGMENTS = 4  # lengths of a segment in the signal; they overlap by half
_SHARED = 1 / 36  # correlation of the powers of two Hann windows that overlap by half (Welch 1967)
_STILL = 1e-12  # of its largest value: a signal that changes by less is constant but for rounding


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectra of some signals (Welch 1967: Hann windows, overlapping by half).

    Attributes:
        frequency: [Hz], shape (F,), rising from 0.
        power: density [unit²/Hz], shape (F, w).
        low, high: its 95 % confidence interval, shape (F, w): each segment's power is as that of Gaussian noise, and
            segments that overlap by half are almost independent. At 0 Hz and at half the rate a segment has one degree
            of freedom, elsewhere two.
    """

    frequency: Array
    power: Array
    low: Array
    high: Array


def spectrum(t: Array, values: Array, segments: int = SEGMENTS) -> Spectrum:
    """Spectra of smooth signals about their mean.

    Args:
        t: times of the rows [s], rising, shape (N,).
        values: shape (N, w).
        segments: lengths of a segment in the signal.
    """
    from scipy.special import chdtri

    even, smooth = resample(t, values)
    smooth, step = level_still(smooth), float(even[-1] - even[0]) / (len(even) - 1)
    length = max(len(even) // segments, 2)
    parts = cut_windows(smooth - smooth[0], length)
    frequency = np.asarray(np.fft.rfftfreq(length, step), float)
    power = (np.abs(np.fft.rfft(parts, axis=1)) ** 2).mean(axis=0)
    alone = np.zeros(len(frequency), dtype=bool)  # lines without a partner at −f, which are real
    alone[0], alone[-1] = True, length % 2 == 0
    power *= np.where(alone, 1.0, 2.0)[:, None] * step / (hann(length) ** 2).sum()
    degrees = _degrees_of_freedom(len(frequency), length, len(parts))
    low, high = (power * (degrees / chdtri(degrees, p))[:, None] for p in (0.025, 0.975))
    return Spectrum(frequency, power, low, high)


def _degrees_of_freedom(lines: int, length: int, count: int) -> Array:
    """Degrees of freedom of the mean power of ``count`` windows of white noise that overlap by half, shape (lines,).

    A line is X_j = Σ v(t) e(t) in window j, with the covariances c_jl = E X_j X̄_l and p_jl = E X_j X_l. The variance of
    Σ|X_j|² is Σ|c_jl|² + |p_jl|², and the degrees of freedom are those of a χ² with the same mean and variance. Far
    from both ends p is 0; next to them Hann's window mixes a line with its partner at −f, and the mean that was
    subtracted is missing.
    """
    degrees = np.full(lines, 2 * count / (1 + 2 * _SHARED * (count - 1) / count))
    t, lag = np.arange(length), length // 2
    for line in {0, 1, lines - 2, lines - 1} & set(range(lines)):
        v = hann(length) * np.exp(-2j * np.pi * line * t / length)
        v -= v.mean()
        c, p = (np.abs(np.array([v @ w, v[lag:] @ w[: length - lag]])) ** 2 for w in (v.conj(), v))
        degrees[line] = 2 * count / (1 + p[0] / c[0] + 2 * (count - 1) / count * (c[1] + p[1]) / c[0])
    return degrees


def hann(length: int) -> Array:
    """Hann's window, of which the row after the last would be the first again; shape (length,)."""
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length))


def cut_windows(values: Array, length: int, detrend: Literal["constant", "linear"] = "constant") -> Array:
    """Windows of signals, from the first row to the last, without their mean or trend and weighted by Hann's window.

    They overlap by half, or by as much more as it takes for the last to end with the record.

    Args:
        values: shape (N, w), N at least ``length``.
        length: rows of a window.
        detrend: what is subtracted from each.

    Returns:
        shape (windows, length, w).
    """
    from scipy.signal import detrend as without

    gaps = -(-2 * (len(values) - length) // (length + 1))  # half a window each, to half a row
    starts = np.rint(np.linspace(0, len(values) - length, gaps + 1)).astype(int)
    parts = without(np.stack([values[first : first + length] for first in starts]), axis=1, type=detrend)
    return np.asarray(parts * hann(length)[:, None])


def level_still(values: Array) -> Array:
    """Signals (N, w), of which those that change by nothing but rounding do not change."""
    still = np.ptp(values, axis=0) <= _STILL * np.abs(values).max(axis=0)
    return np.where(still, values[0], values)


BLOCKS = 10
TRANSIENT = 0.1  # part of the run that is left to the start
FEWEST = 20  # rows below which there is nothing to tell


@dataclass(frozen=True)
class Estimate:
    """A number from a finite run.

    Attributes:
        value: the number.
        error: half the width of its 95 % confidence interval; NaN where the run is too short to tell.
    """

    value: float
    error: float


def mean(values: Array, blocks: int = BLOCKS) -> Estimate:
    """The mean of a sequence, shape (N,)."""
    return Estimate(float(values.mean()), half_width(_averages(values, blocks)))


def deviation(values: Array, blocks: int = BLOCKS) -> Estimate:
    """The standard deviation of a sequence, shape (N,); for a signal its RMS about the mean."""
    squares = (values - values.mean()) ** 2
    size = float(np.sqrt(squares.mean()))
    return Estimate(size, half_width(_averages(squares, blocks)) / (2 * size) if size > 0 else 0.0)


def half_width(averages: Array) -> float:
    """Half the width of the 95 % interval of the mean of independent averages, by Student's t; NaN for fewer than two.

    Args:
        averages: shape (B,).
    """
    from scipy.special import stdtrit

    count = len(averages)
    if count < 2:
        return float("nan")
    return float(stdtrit(count - 1, 0.975) * averages.std(ddof=1) / np.sqrt(count))


def _averages(values: Array, blocks: int) -> Array:
    """Averages over as many blocks of the same length, at least two values each; the first values are left over."""
    count = min(blocks, len(values) // 2)
    length = len(values) // count if count else 0
    return values[len(values) - count * length :].reshape(count, -1).mean(axis=1) if count else np.zeros(0)


@dataclass(frozen=True, eq=False)
class Statistics:
    """Distributions over a run without its first tenth, each number with its 95 % confidence from block averages.

    The confidence is valid for runs much longer than the correlation time of the motion; a block is a tenth of the
    remaining run.

    Attributes:
        start, end: the part of the run that is evaluated [s].
        events: number of events in it.
        interval: mean open-loop interval [s]; ``None`` with fewer than two events.
        interval_deviation: standard deviation of the intervals [s]; ``None`` with fewer than two events.
        least: the minimum interval [s], the larger of Δ_min (the refractory period) and the delay.
        binding: share of the intervals that equal this minimum, for which the minimum and not the threshold determined
            the event.
        edges, counts: histogram of the intervals: edges of its bins [s] and counts, shapes (B + 1,) and (B,); empty
            without intervals.
        mean, rms: mean of every output, and root mean square about that mean; length n_y.
        spectrum: spectrum of every output.
    """

    start: float
    end: float
    events: int
    interval: Estimate | None
    interval_deviation: Estimate | None
    least: float
    binding: Estimate | None
    edges: Array
    counts: Array
    mean: tuple[Estimate, ...]
    rms: tuple[Estimate, ...]
    spectrum: Spectrum

    @property
    def words(self) -> str:
        """The statistics in one sentence."""
        sizes = ", ".join(show(rms) for rms in self.rms)
        sway = f"RMS of the outputs {sizes}"
        if self.interval is None or self.interval_deviation is None or self.binding is None:
            return f"Driven by noise: {sway}."
        least = f", at the least of {self.least:g} s in {show(self.binding, 100)} % of them" if self.least > 0 else ""
        return (
            f"Driven by noise: open-loop interval {show(self.interval)} s on average, "
            f"deviation {show(self.interval_deviation)} s, over {self.events} events{least}; {sway}."
        )


def statistics(simulation: Simulation) -> Statistics | None:
    """The statistics of a run on either plant; ``None`` if it fell or diverged, or is too short."""
    end = float(simulation.t[-1])
    start = TRANSIENT * end
    rows = is_between(simulation.t, start)
    if simulation.outcome.kind in ("fell", "diverged") or rows.sum() < FEWEST:
        return None
    t, y = simulation.t[rows], simulation.y[rows]
    _, even = resample(t, y)
    intervals = simulation.events.interval[is_between(simulation.events.t, start)]
    several = len(intervals) >= 2
    none = np.zeros(0), np.zeros(0)
    bins = max(10, int(np.ceil(2 * len(intervals) ** (1 / 3))))  # by Rice's rule
    counts, edges = np.histogram(intervals, bins, find_range(intervals)) if several else none
    at_least = is_between(intervals, simulation.least, simulation.least)
    return Statistics(
        start=start,
        end=end,
        events=len(intervals),
        interval=mean(intervals) if several else None,
        interval_deviation=deviation(intervals) if several else None,
        least=simulation.least,
        binding=mean(at_least.astype(float)) if several else None,
        edges=np.asarray(edges, float),
        counts=np.asarray(counts, float),
        mean=tuple(mean(column) for column in even.T),
        rms=tuple(deviation(column) for column in even.T),
        spectrum=spectrum(t, y),
    )


def show(estimate: Estimate, unit: float = 1.0) -> str:
    """``0.52 ± 0.03``; in another unit, times ``unit``."""
    value, error = estimate.value * unit, estimate.error * unit
    return f"{value:.3g}" + (f" ± {error:.2g}" if np.isfinite(error) and error > 0 else "")


_BINS, _STEPS = 256, 20  # of the range, and halvings of the bandwidth's logarithm
_NOTHING = 1e-9  # of the highest density: a rise that is less is rounding
_NARROWEST = 1 / 100  # of the range
_INNER = (0.025, 0.975)  # quantiles between which values are looked at


@dataclass(frozen=True)
class Modality:
    """The result of a test of one mode against several.

    Attributes:
        bandwidth: critical bandwidth divided by the standard deviation.
        p: share of samples with one mode whose critical bandwidth is at least as large; it is small if there are
            several modes.
        count: number of values that were tested.
    """

    bandwidth: float
    p: float
    count: int


def modality(values: Array, *, signal: bool = False, resamples: int = 199, seed: int = 0) -> Modality:
    """Test whether values have one mode.

    Args:
        values: the values, shape (N,).
        signal: whether they are an evenly sampled signal over time rather than independent values.
        resamples: number of samples with one mode with which they are compared.
        seed: seed of these samples.

    Raises:
        DataError: if there are too few values, one is not finite, or all are equal. Where only the outermost 5 % differ
            from the others, there is one mode, of no width: p = 1.
    """
    x = np.asarray(values, dtype=float)
    if x.ndim != 1 or len(x) < FEWEST or not np.isfinite(x).all():
        raise DataError(f"{x.size} values; expected at least {FEWEST}, all finite")
    x = x - x.mean()
    deviation = float(x.std())
    if not deviation > _STILL * np.abs(values).max():
        raise DataError("all values are the same; they have no distribution")
    x, random = x / deviation, np.random.default_rng(seed)
    if np.ptp(_inner(x)) <= RELATIVE_ROUNDING:  # deviations
        return Modality(0.0, 1.0, len(x))
    h = _critical(x)
    larger = 0
    for _ in range(resamples):
        if signal:
            larger += _critical(_surrogate(x, random)) >= h
        else:
            # of the smoothed distribution, drawn in to the variance of the sample
            drawn = random.choice(x, len(x)) + h * random.standard_normal(len(x))
            larger += _modes(_Histogram(drawn / np.sqrt(1 + h**2)), h) > 1
    return Modality(h, (1 + larger) / (1 + resamples), len(x))


class _Histogram:
    """Counts of the inner values in fine bins with room on either side, ready to be smoothed."""

    def __init__(self, x: Array) -> None:
        x = _inner(x)
        self.range = float(np.ptp(x))
        middle = (x.max() + x.min()) / 2
        # a range on either side: what a transform wraps around comes to nothing
        counts, _ = np.histogram(x, 3 * _BINS, (middle - 1.5 * self.range, middle + 1.5 * self.range))
        self.spectrum = np.fft.rfft(counts)
        self.turn = 2 * np.pi * np.fft.rfftfreq(3 * _BINS, self.range / _BINS)


def _inner(x: Array) -> Array:
    low, high = np.quantile(x, _INNER)
    return x[(x >= low) & (x <= high)]


def _modes(histogram: _Histogram, h: float) -> int:
    density = np.fft.irfft(histogram.spectrum * np.exp(-((histogram.turn * h) ** 2) / 2), 3 * _BINS)
    change = np.diff(density)
    change = change[np.abs(change) > _NOTHING * density.max()]
    return int(((change[:-1] > 0) & (change[1:] < 0)).sum())


def _critical(x: Array) -> float:
    """The least bandwidth with a single mode, to a hundredth: fewer modes are left the wider it is."""
    histogram = _Histogram(x)
    low, high = _NARROWEST * histogram.range, histogram.range / 2
    for _ in range(_STEPS):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if _modes(histogram, middle) <= 1 else (middle, high)
        if high < 1.001 * low:
            break
    return float(high)


def _surrogate(x: Array, random: np.random.Generator) -> Array:
    """A signal of the same spectrum with random phases, of deviation 1."""
    Y = np.fft.rfft(x)
    phases = np.exp(2j * np.pi * random.random(len(Y)))
    phases[0] = 1
    found = np.fft.irfft(np.abs(Y) * phases, len(x))
    return np.asarray(found / found.std(), float)
