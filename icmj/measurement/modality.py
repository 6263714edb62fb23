"""Whether a distribution has one mode or several: Silverman's critical bandwidth, compared with surrogates of one mode.

A Gaussian kernel of width h smooths a sample; the wider it is, the fewer modes are left. The *critical bandwidth* is
the least width with a single one: large relative to the standard deviation where there are two clusters (Silverman
1981, J. R. Stat. Soc. B 43:97–99). Independent values are compared with samples of the smoothed distribution itself,
which has one mode, as Silverman does. Values of a signal are not independent: a slow signal of one mode also stays
near some values for long. They are compared with signals of the same spectrum and random phases, which are Gaussian
(Theiler et al. 1992, Physica D 58:77–94). The test is conservative where the single mode is peaked, and not where it
is flat, so that only a very small p indicates several modes. The outermost 5 % of the values are left out: bumps of a
tail are no modes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import SAME, Array
from icmj.errors import DataError

FEWEST = 20  # values
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
    if not deviation > 1e-12 * np.abs(values).max():
        raise DataError("all values are the same; they have no distribution")
    x, random = x / deviation, np.random.default_rng(seed)
    if np.ptp(_inner(x)) <= SAME:  # deviations
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
