"""The distribution of a signal's power over frequency: mean, median and edge frequencies, and slope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array, is_between
from icmj.errors import DataError
from icmj.measurement.measure import Definition, Number, Signal, define_measure

SLOPE = (0.1, 0.7)  # Hz
FEWEST_LINES = 4  # of the spectrum in that band, below which there is no slope


@dataclass(frozen=True)
class Frequencies:
    """Distribution of a signal's power over frequency, within a band.

    Attributes:
        mean: ∫f P df / ∫P df [Hz].
        median: frequency below which half of the power lies [Hz].
        edge: frequency below which 95 % of the power lies [Hz].
        slope: slope of log P against log f from 0.1 to 0.7 Hz, both included, independent of the band; NaN with fewer
            than four lines.
    """

    mean: float
    median: float
    edge: float
    slope: float


def frequencies(frequency: Array, power: Array, band: tuple[float, float] = (0.0, np.inf)) -> Frequencies:
    """Distribution of the power of a spectrum over frequency, by the trapezoidal rule; NaN without power.

    Args:
        frequency: [Hz], rising, shape (F,).
        power: density, shape (F,).
        band: what of it counts [Hz], both ends included.

    Raises:
        DataError: if fewer than two lines are in the band.
    """
    if is_between(frequency, *band).sum() < 2:
        raise DataError(f"no two lines of the spectrum from {band[0]:g} to {band[1]:g} Hz; widen the band")
    low, high = (float(np.clip(edge, frequency[0], frequency[-1])) for edge in band)
    # between two lines the power is that of the straight line between them, also where the band begins or ends there
    f = np.concatenate([[low], frequency[(frequency > low) & (frequency < high)], [high]])
    P = np.interp(f, frequency, power)
    below = np.concatenate([[0.0], np.cumsum(np.diff(f) * (P[1:] + P[:-1]) / 2)])
    if not below[-1] > 0:
        return Frequencies(np.nan, np.nan, np.nan, np.nan)
    median, edge = np.interp([0.5, 0.95], below / below[-1], f)
    mean = np.trapezoid(f * P, f) / below[-1]
    return Frequencies(float(mean), float(median), float(edge), _slope(frequency, power))


def _slope(f: Array, P: Array) -> float:
    """The slope by least squares, of lines by how much of their distance from the others they lie in the band.

    A line within it counts as one, and one beyond its end by a share of the distance between lines as that much less:
    so a record that is longer by a row, whose lines lie a little closer, has nearly the same.
    """
    beyond = np.maximum(SLOPE[0] - f, f - SLOPE[1]) / (f[1] - f[0])
    weight = np.clip(1 - beyond, 0, 1) * ((P > 0) & (f > 0))
    low = weight > RELATIVE_ROUNDING
    if is_between(f[low], *SLOPE).sum() < FEWEST_LINES:
        return np.nan
    return float(np.polynomial.polynomial.polyfit(np.log(f[low]), np.log(P[low]), 1, w=np.sqrt(weight[low]))[1])


@define_measure(
    "frequencies", standard=True,
    numbers=[
        Number("frequency.mean", "mean frequency", "Hz", "mean"),
        Number("frequency.median", "median frequency", "Hz", "median"),
        Number("frequency.edge", "95 % frequency", "Hz", "edge"),
        Number("frequency.slope", "slope of spectrum", "", "slope"),
    ],
    definitions=[
        Definition(
            "spectrum $S(f)$",
            "Welch's method with Hann windows of half the record, which overlap by half, or by one row less, so that "
            "no row is left out; the mean of each window is removed",
            "Welch 1967; Santos & Duarte 2016",
        ),
        Definition(
            "mean frequency",
            r"$\int f S\,\mathrm{d}f / \int S\,\mathrm{d}f$ by the trapezoidal rule; in a plane, $S$ is the sum of "
            r"both spectra. This is not the centroidal frequency "
            r"$\sqrt{\int f^2 S\,\mathrm{d}f/\int S\,\mathrm{d}f}$ of Prieto 1996 (CFREQ)",
            "Santos & Duarte 2016",
        ),
        Definition(
            "median frequency, 95 % frequency", "the frequency below which half, or 95 %, of the power lies",
            "Prieto 1996",
        ),
        Definition(
            "slope of spectrum",
            r"slope of $\log S$ against $\log f$ from 0.1 to 0.7 Hz, both included; a line outside by less than the "
            "distance of two lines counts for the rest of that distance",
        ),
    ],
)  # fmt: skip
def of_signal(signal: Signal, *, band: tuple[float, float] = (0.0, np.inf)) -> Frequencies:
    """Distribution of the power over frequency, of a plane that of the sum of both spectra.

    Args:
        signal: a coordinate or a plane.
        band: lowest and highest frequency of the spectral measures [Hz] (default: all frequencies).
    """
    if not 0 <= band[0] < band[1]:
        raise DataError(f"a band of {band[0]:g} to {band[1]:g} Hz; expected two rising numbers from 0 on")
    return frequencies(signal.frequency, signal.power, band)


MEASURE = of_signal
