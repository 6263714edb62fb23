"""Measures of sway, as used in posturography for the centre of pressure (definitions, sources: docs/measures.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array, between
from icmj.base.card import Card, WithCard
from icmj.base.numbers import amount
from icmj.errors import DataError
from icmj.measurement.ellipse import Ellipse, prediction_ellipse, prediction_range
from icmj.measurement.power_distribution import Frequencies, frequencies
from icmj.measurement.stabilogram import Diffusion, diffusion
from icmj.measurement.statistics import Spectrum, level_still, spectrum
from icmj.series.even_rows import even_series
from icmj.series.series import Series
from icmj.series.units import in_si

FEWEST = 20  # rows below which there is nothing to measure
SEGMENTS = 2  # lengths of a segment of the spectrum in the record


@dataclass(frozen=True, eq=False)
class Coordinate:
    """Measures of one coordinate, about its mean.

    Attributes:
        name, unit: name and unit of the coordinate.
        mean: mean value [unit].
        rms: root mean square about the mean [unit] (Prieto et al. 1996: RDIST).
        mean_distance: mean magnitude about the mean [unit] (MDIST).
        range: largest minus smallest value [unit] (RANGE).
        prediction_range: width of the 95 % prediction interval [unit].
        speed: mean speed, the total path length divided by the duration [unit/s] (MVELO).
        rotation_frequency: speed / (4√2 mean_distance) [Hz], as printed by Prieto et al. (MFREQ); 1.11 f for a sinusoid
            of frequency f.
        frequencies: distribution of its power over frequency.
        diffusion: stabilogram diffusion.
    """

    name: str
    unit: str
    mean: float
    rms: float
    mean_distance: float
    range: float
    prediction_range: float
    speed: float
    rotation_frequency: float
    frequencies: Frequencies
    diffusion: Diffusion


@dataclass(frozen=True, eq=False)
class Plane:
    """Measures of two coordinates together.

    Attributes:
        names, unit: names and common unit of the coordinates.
        rms, mean_distance: root mean square and mean of the distance from the mean point [unit].
        speed: mean speed, the length of the path divided by the duration [unit/s].
        rotation_frequency: frequency of a rotation on a circle with this mean distance and speed [Hz] (MFREQ).
        ellipse: 95 % prediction ellipse.
        frequencies: distribution of the sum of both power spectra over frequency.
        diffusion: stabilogram diffusion, ⟨Δr²⟩.
    """

    names: tuple[str, str]
    unit: str
    rms: float
    mean_distance: float
    speed: float
    rotation_frequency: float
    ellipse: Ellipse
    frequencies: Frequencies
    diffusion: Diffusion


@dataclass(frozen=True)
class Measure:
    """One measure of a coordinate, or of a plane.

    Attributes:
        key: its name in batches of runs, such as ``frequency.median``.
        words: what it is called.
        unit: its unit, with ``U`` for that of the coordinate.
        of: attribute that holds it, by its way from the coordinate or the plane.
    """

    key: str
    words: str
    unit: str
    of: str

    def value(self, found: Coordinate | Plane) -> float:
        """The measure; NaN if the record was too short for it."""
        value: Any = found
        for name in self.of.split("."):
            value = value[int(name)] if name.isdecimal() else getattr(value, name)
            if value is None:
                return float("nan")
        return float(value)

    def unit_of(self, unit: str) -> str:
        """Its unit where that of the coordinate is ``unit``."""
        return self.unit.replace("U", unit)


_OF_BOTH = (
    Measure("frequency.mean", "mean frequency", "Hz", "frequencies.mean"),
    Measure("frequency.median", "median frequency", "Hz", "frequencies.median"),
    Measure("frequency.edge", "95 % frequency", "Hz", "frequencies.edge"),
    Measure("frequency.slope", "slope of spectrum", "", "frequencies.slope"),
    Measure("short.H", "H, short times", "", "diffusion.short.H"),
    Measure("short.D", "D, short times", "U²/s", "diffusion.short.D"),
    Measure("long.H", "H, long times", "", "diffusion.long.H"),
    Measure("long.D", "D, long times", "U²/s", "diffusion.long.D"),
    Measure("critical.lag", "critical lag", "s", "diffusion.critical.0"),
    Measure("critical.displacement", "critical displacement", "U²", "diffusion.critical.1"),
)
_RMS = Measure("rms", "RMS", "U", "rms")
_DISTANCE = Measure("mean_distance", "mean distance", "U", "mean_distance")
_SPEED = Measure("speed", "mean speed", "U/s", "speed")
_ROTATION = Measure("rotation_frequency", "rotation frequency", "Hz", "rotation_frequency")
MEASURES = (
    Measure("mean", "mean", "U", "mean"), _RMS, _DISTANCE, Measure("range", "range", "U", "range"),
    Measure("prediction_range", "prediction range", "U", "prediction_range"), _SPEED, _ROTATION, *_OF_BOTH,
)  # fmt: skip
"""The measures of a coordinate: the one list that tables, batches, experiments and fits take them from."""
OF_PLANE = (
    _RMS, _DISTANCE, _SPEED, Measure("ellipse.area", "95 % prediction ellipse, area", "U²", "ellipse.area"),
    Measure("ellipse.major", "ellipse, longer half axis", "U", "ellipse.axes.0"),
    Measure("ellipse.minor", "ellipse, shorter half axis", "U", "ellipse.axes.1"),
    Measure("ellipse.angle", "ellipse, angle", "rad", "ellipse.angle"), _ROTATION, *_OF_BOTH,
)  # fmt: skip
"""Those of a plane."""


@dataclass(frozen=True, eq=False, repr=False)
class Sway(WithCard):
    """Measures of a swaying point, or of any signals.

    Attributes:
        series: the evaluated series: evenly sampled, and filtered if requested.
        duration: N / rate [s].
        rate: samples per second [Hz].
        band: band of the frequency measures [Hz].
        low_pass: cut-off frequency of the filter that is applied before all measures [Hz], or ``None``.
        coordinates: the measures of each signal.
        plane: the measures of two signals with the same unit together, otherwise ``None``.
        spectrum: spectrum of every signal.
    """

    series: Series
    duration: float
    rate: float
    band: tuple[float, float]
    low_pass: float | None
    coordinates: tuple[Coordinate, ...]
    plane: Plane | None
    spectrum: Spectrum

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook: the best-known measures."""
        rows: list[tuple[str, str]] = []
        for c in self.coordinates:
            speed = f"{c.unit}/s" if c.unit else ""
            rows += [
                (f"{c.name}, RMS", amount(c.rms, c.unit, 4)),
                (f"{c.name}, mean speed", amount(c.speed, speed, 4)),
                (f"{c.name}, median frequency", amount(c.frequencies.median, "Hz", 4)),
            ]
        if self.plane is not None:
            area = f"{self.plane.unit}²" if self.plane.unit else ""
            speed = f"{self.plane.unit}/s" if self.plane.unit else ""
            rows.append(("95 % prediction ellipse", amount(self.plane.ellipse.area, area, 4)))
            rows.append(("mean speed in the plane", amount(self.plane.speed, speed, 4)))
        names = ", ".join(c.name for c in self.coordinates)
        return Card(f"{names}, {self.duration:.6g} s at {self.rate:.6g} Hz", tuple(rows))


def measure_sway(
    series: Series,
    columns: Sequence[str] = (),
    *,
    rate: float | None = None,
    low_pass: float | None = None,
    band: tuple[float, float] = (0.0, np.inf),
) -> Sway:
    """Measure the sway of some signals; two signals with the same unit are also measured as a point in a plane.

    Args:
        series: for example from :func:`icmj.read_series` or ``Result.to_series``.
        columns: names of the signals to measure; by default all.
        rate: rate to which the series is resampled by a cubic spline [Hz]; by default its own rate.
        low_pass: cut-off frequency [Hz], at which the gain is 1/√2, of a Butterworth filter of second order that is run
            forward and backward: of fourth order together, without phase shift. Between one period in the record and
            half the rate; by default there is no filter.
        band: band for mean, median and edge frequency [Hz]; Prieto et al. used 0.15 to 5 Hz.

    Raises:
        DataError: if there is no such signal, values are missing, there are gaps or too few rows, or filter or band
            does not fit the rate.
    """
    series = even_series(series.chosen(columns) if columns else series, rate)
    N = len(series)
    if N < FEWEST:
        raise DataError(f"{N} rows; expected at least {FEWEST}")
    step = float(series.t[-1] - series.t[0]) / (N - 1)
    if not 0 <= band[0] < band[1]:
        raise DataError(f"a band of {band[0]:g} to {band[1]:g} Hz; expected two rising numbers from 0 on")
    if low_pass is not None:
        series = replace(series, values=_filter(series.values, low_pass, 1 / step))
    series = replace(series, values=level_still(series.values))
    found = spectrum(series.t, series.values, SEGMENTS)
    coordinates = tuple(
        _coordinate(name, unit, values, step, frequencies(found.frequency, power, band))
        for name, unit, values, power in zip(series.names, series.units, series.values.T, found.power.T, strict=True)
    )
    plane = None
    if len(coordinates) == 2 and len(set(series.units)) == 1:
        plane = _plane(series, step, frequencies(found.frequency, found.power.sum(axis=1), band))
    return Sway(series, N * step, 1 / step, band, low_pass, coordinates, plane, found)


def sway_numbers(series: Series, low_pass: float | None = None) -> dict[str, Array]:
    """Measures of sway by signal and key, such as ``trunk.frequency.median``; NaN of a run that was too short."""
    if len(series) < FEWEST:
        return {f"{name}.{measure.key}": np.asarray(np.nan) for name in series.names for measure in MEASURES}
    found = measure_sway(series, low_pass=low_pass).coordinates
    return {f"{of.name}.{measure.key}": np.asarray(measure.value(of)) for of in found for measure in MEASURES}


def from_torque(series: Series, torque: str, weight: float) -> Series:
    """The centre of pressure in front of the ankle from the torque there, −τ / weight, as the signal ``cop`` [m].

    It is what a foot at rest that carries ``weight`` feels: the share of horizontal force and of the foot's own mass,
    both small in quiet standing, is left out.

    Args:
        series: holds the torque on the body, positive where it leans the body forwards, in N m, N cm or N mm.
        torque: which signal that is.
        weight: vertical force on the foot [N].

    Raises:
        DataError: if there is no such signal, it has no unit or one that is no torque's, or the weight is not positive.
    """
    if not (np.isfinite(weight) and weight > 0):
        raise DataError(f"a weight must be positive and finite, got {weight:g} N")
    moment = in_si(series.chosen([torque]), "torque")
    return replace(moment, values=-moment.values / weight, names=("cop",), units=("m",))


def _coordinate(name: str, unit: str, values: Array, step: float, found: Frequencies) -> Coordinate:
    from_first = values - values[0]  # its mean and what is about it are exact where nothing moves
    about = from_first - from_first.mean()
    distance = float(np.abs(about).mean())
    speed = float(np.abs(np.diff(values)).sum() / (len(values) * step))
    return Coordinate(
        name=name,
        unit=unit,
        mean=float(values[0] + from_first.mean()),
        rms=float(np.sqrt((about**2).mean())),
        mean_distance=distance,
        range=float(np.ptp(values)),
        prediction_range=prediction_range(about),
        speed=speed,
        rotation_frequency=speed / (4 * np.sqrt(2) * distance) if distance > 0 else np.nan,
        frequencies=found,
        diffusion=diffusion(about, 1 / step),
    )


def _plane(series: Series, step: float, found: Frequencies) -> Plane:
    from_first = series.values - series.values[0]
    about = from_first - from_first.mean(axis=0)
    distance = np.hypot(*about.T)
    speed = float(np.hypot(*np.diff(about, axis=0).T).sum() / (len(about) * step))
    ellipse, (first, second) = prediction_ellipse(about), series.names
    return Plane(
        names=(first, second),
        unit=series.units[0],
        rms=float(np.sqrt((distance**2).mean())),
        mean_distance=float(distance.mean()),
        speed=speed,
        rotation_frequency=speed / (2 * np.pi * distance.mean()) if distance.any() else np.nan,
        ellipse=replace(ellipse, centre=series.values[0] + from_first.mean(axis=0)),
        frequencies=found,
        diffusion=diffusion(about, 1 / step),
    )


def _filter(values: Array, corner: float, rate: float) -> Array:
    from scipy.signal import butter, sosfiltfilt

    lowest = rate / len(values)  # beneath one period in the record nothing is left, and the filter's poles round to 1
    if not (between(corner, lowest) and corner < (1 - RELATIVE_ROUNDING) * rate / 2):
        raise DataError(
            f"a low-pass of {corner:g} Hz; expected from {lowest:.3g} Hz, one period in the record, to below half the "
            f"rate, {rate / 2:g} Hz"
        )
    # that of each pass is higher: of their gains, 1/√(1 + (Ω/Ω_c)⁴), the product is to be 1/√2 at the corner
    once = float(np.arctan(np.tan(np.pi * corner / rate) / (np.sqrt(2) - 1) ** 0.25)) * rate / np.pi
    return np.asarray(sosfiltfilt(butter(2, once, fs=rate, output="sos"), values, axis=0), float)
