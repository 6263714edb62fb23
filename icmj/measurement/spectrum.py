"""Power spectra of signals whose rows are not evenly spaced, because events are recorded when they come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.measurement.blocks import half_width

SEGMENTS = 4  # lengths of a segment in the signal; they overlap by half
_CLOSE = 0.1  # of the usual distance between rows: one this close to the row before it adds nothing but rounding


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectra of some signals (Welch 1967: Hann windows, overlapping by half).

    Attributes:
        frequency: [Hz], shape (F,), rising from 0.
        power: density [unit²/Hz], shape (F, w).
        error: half the width of its 95 % confidence interval, from the scatter of the segments, shape (F, w).
    """

    frequency: Array
    power: Array
    error: Array


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
    from scipy.signal import spectrogram

    even, smooth = evenly(t, values)
    length = max(len(even) // segments, 2)
    # what Welch's method averages, kept apart for the scatter
    frequency, _, power = spectrogram(
        smooth, 1 / (even[1] - even[0]), "hann", length, length // 2, detrend="constant", axis=0
    )
    error = np.apply_along_axis(half_width, 2, power)
    return Spectrum(frequency, power.mean(axis=2), error)
