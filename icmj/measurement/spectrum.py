"""Power spectra of signals whose rows are not evenly spaced, because events are recorded when they come."""

from __future__ import annotations

from dataclasses import dataclass

from icmj.base.array import Array
from icmj.series.even import evenly

SEGMENTS = 4  # lengths of a segment in the signal; they overlap by half
_SHARED = 1 / 36  # correlation of the powers of two Hann windows that overlap by half (Welch 1967)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectra of some signals (Welch 1967: Hann windows, overlapping by half).

    Attributes:
        frequency: [Hz], shape (F,), rising from 0.
        power: density [unit²/Hz], shape (F, w).
        low, high: its 95 % confidence interval, shape (F, w): each segment's power is as that of Gaussian noise, and
            segments that overlap by half are almost independent.
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
    from scipy.signal import welch
    from scipy.special import chdtri

    even, smooth = evenly(t, values)
    length = max(len(even) // segments, 2)
    frequency, power = welch(smooth, 1 / (even[1] - even[0]), "hann", length, detrend="constant", axis=0)
    count = max((len(even) - length) // (length - length // 2) + 1, 1)
    degrees = 2 * count / (1 + 2 * _SHARED * (count - 1) / count)
    return Spectrum(
        frequency, power, power * degrees / chdtri(degrees, 0.025), power * degrees / chdtri(degrees, 0.975)
    )
