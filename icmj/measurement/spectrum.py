"""Power spectra of signals whose rows are not evenly spaced, because events are recorded when they come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array

SEGMENTS = 4  # lengths of a segment in the signal; they overlap by half
_SHARED = 1 / 36  # correlation of the powers of two Hann windows that overlap by half (Welch 1967)
_CLOSE = 0.1  # of the usual distance between rows: one this close to the row before it adds nothing but rounding


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


def evenly(t: Array, values: Array) -> tuple[Array, Array]:
    """Smooth signals at even times, by a cubic spline through their rows; at the usual distance of the rows.

    Args:
        t: times of the rows [s], rising, shape (N,).
        values: shape (N, w).

    Returns:
        times (M,) and values (M, w).
    """
    from scipy.interpolate import CubicSpline

    step = float(np.median(np.diff(t)))
    kept = np.concatenate([[True], np.diff(t) > _CLOSE * step])
    even = t[0] + step * np.arange(int((t[kept][-1] - t[0]) / step * (1 + 1e-12)) + 1)
    return even, CubicSpline(t[kept], values[kept])(even)


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
