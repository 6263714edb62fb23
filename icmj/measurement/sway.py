"""Measures of sway, as used in posturography for the centre of pressure (definitions, sources: docs/measures.md).

Prediction ellipse and range of a sway, which contain a further value with a given probability.

Stabilogram diffusion: the mean square displacement of sway against the time lag (Collins & De Luca 1993).

Over short times sway is persistent and moves away from its position; over long times it returns. Both appear as
straight lines in the mean square displacement against time on logarithmic axes, with slope 2H: H = 1/2 is a random
walk, larger values are persistent, smaller ones anti-persistent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array, between, steps_in
from icmj.base.numbers import Card, WithCard, amount
from icmj.errors import DataError
from icmj.measurement.statistics import Spectrum, level_still, spectrum
from icmj.series.series import Series, even_series
from icmj.series.units import in_si

LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Ellipse:
    """The prediction ellipse of points in a plane: a further point lies in it with probability ``level``.

    Not to be confused with the confidence ellipse of the mean, which shrinks as the record grows.

    Attributes:
        centre: mean, shape (2,).
        axes: half lengths of the axes, the longer first, shape (2,) [unit].
        angle: of the longer axis from the first coordinate, in (−π/2, π/2] [rad].
        level: probability.
    """

    centre: Array
    axes: Array
    angle: float
    level: float = LEVEL

    @property
    def area(self) -> float:
        """π a b [unit²]."""
        return float(np.pi * self.axes.prod())

    def outline(self, points: int = 181) -> Array:
        """The ellipse as a closed curve, shape (points, 2)."""
        turn = np.linspace(0, 2 * np.pi, points)
        along = np.array([np.cos(self.angle), np.sin(self.angle)])
        across = np.array([-along[1], along[0]])
        return (
            self.centre + np.outer(self.axes[0] * np.cos(turn), along) + np.outer(self.axes[1] * np.sin(turn), across)
        )


def prediction_ellipse(points: Array, level: float = LEVEL) -> Ellipse:
    """The prediction ellipse of normally distributed points, with the exact factor for their number.

    They are taken as independent: of a record that is not much longer than the memory of its motion, fewer further
    points lie in it.

    The squared half axes are the eigenvalues of the covariance times 2(N+1)(N−1)/(N(N−2)) F(2, N−2) (Chew 1966,
    J Am Stat Assoc 61:605-617). The factor tends to the quantile of χ² with two degrees of freedom, which
    the code of Schubert & Kirchner (2014, Gait Posture 39:518-522) takes: 0.08 % less at N = 6000.

    Args:
        points: shape (N, 2), N > 2.
        level: probability.
    """
    from scipy.special import fdtri

    N = len(points)
    factor = 2 * (N + 1) * (N - 1) / (N * (N - 2)) * fdtri(2, N - 2, level)
    variances, directions = np.linalg.eigh(np.cov(points.T))
    along = directions[:, 1]
    angle = float(np.arctan2(along[1], along[0]))
    angle = angle - np.pi if angle > np.pi / 2 else angle + np.pi if angle <= -np.pi / 2 else angle
    return Ellipse(points.mean(axis=0), np.sqrt(factor * np.maximum(variances[::-1], 0)), angle, level)


def prediction_range(values: Array, level: float = LEVEL) -> float:
    """Width of the interval about the mean that holds a further value with probability ``level``: 2 t s √(1 + 1/N).

    Values are taken as independent: of a record that is not much longer than the memory of its motion, fewer further
    ones lie in it.

    Args:
        values: shape (N,), N > 1, normally distributed.
        level: probability.
    """
    from scipy.special import stdtrit

    N = len(values)
    return float(2 * stdtrit(N - 1, (1 + level) / 2) * values.std(ddof=1) * np.sqrt(1 + 1 / N))


SHORT = (0.05, 0.5)
LONG = (2.5, 10.0)
"""Windows of the fits [s]. Collins & De Luca chose them by eye, the short one up to about 1 s, the long one to 10 s."""
FEWEST_LAGS = 2.0  # lengths of a lag that a record must have: from fewer, its mean square is no average


@dataclass(frozen=True)
class Regime:
    """A range of lags of the diffusion plot.

    Attributes:
        start, end: first and last lag [s].
        H: scaling exponent, half the slope on logarithmic axes.
        D: diffusion coefficient, half the slope on linear axes [unit²/s].
        offset: value of this line at lag zero [unit²].
    """

    start: float
    end: float
    H: float
    D: float
    offset: float


@dataclass(frozen=True, eq=False)
class Diffusion:
    """The stabilogram-diffusion plot of one coordinate, or of a point in a plane.

    Attributes:
        lag: time differences [s], increasing from one step, shape (M,).
        displacement: mean square displacement [unit²], for a point in a plane the sum over both coordinates, shape
            (M,).
        short, long: the fitted lines; ``None`` if the record is too short or too coarse for a line.
    """

    lag: Array
    displacement: Array
    short: Regime | None
    long: Regime | None

    @property
    def critical(self) -> tuple[float, float] | None:
        """Lag [s] and mean square displacement [unit²] at which the straight lines on linear axes meet, or ``None``."""
        if self.short is None or self.long is None or not self.short.D > self.long.D:
            return None
        lag = (self.long.offset - self.short.offset) / (2 * (self.short.D - self.long.D))
        return (float(lag), float(self.short.offset + 2 * self.short.D * lag)) if lag > 0 else None


def diffusion(
    values: Array,
    rate: float,
    *,
    short: tuple[float, float] = SHORT,
    long: tuple[float, float] = LONG,
) -> Diffusion:
    """The stabilogram diffusion of evenly sampled sway.

    ⟨Δx²⟩ at a lag is the mean over all pairs of samples with this time difference; for a plane ⟨Δr²⟩ = ⟨Δx²⟩ + ⟨Δy²⟩.
    The lines are ⟨Δx²⟩ = 2 D Δt + c, and log ⟨Δx²⟩ = 2 H log Δt + c, fitted by least squares to all lags within each
    window.

    Args:
        values: the coordinate, shape (N,), or both coordinates of a plane, shape (N, 2).
        rate: samples per second [Hz].
        short, long: windows of the fits [s].
    """
    N = len(values)
    most = min(steps_in(long[1] * rate), steps_in((N - 1) / FEWEST_LAGS))
    lags = np.arange(1, most + 1)
    displacement = np.zeros(most)
    for column in np.atleast_2d(values.T):
        displacement += _mean_squares(column, most)
    lag = lags / rate
    return Diffusion(lag, displacement, _regime(lag, displacement, short), _regime(lag, displacement, long))


def _mean_squares(values: Array, most: int) -> Array:
    """⟨(x_{i+m} − x_i)²⟩ for m = 1 … ``most``, from the autocorrelation by fast Fourier transforms; shape (most,)."""
    from scipy.fft import irfft, next_fast_len, rfft

    x, N = values - values.mean(), len(values)
    size = next_fast_len(N + most + 1, real=True)
    spectrum = rfft(x, size)
    products = irfft(spectrum * np.conj(spectrum), size)[1 : most + 1]
    lags = np.arange(1, most + 1)
    total = np.concatenate([[0.0], np.cumsum(x**2)])
    squares = (total[-1] - total[lags]) + total[N - lags]
    return np.maximum(squares - 2 * products, 0) / (N - lags)


def _regime(lag: Array, displacement: Array, window: tuple[float, float]) -> Regime | None:
    inside, reaches = between(lag, *window), between(lag[-1:], window[1]).any()
    if inside.sum() < 3 or not (displacement[inside] > 0).all() or not reaches:
        return None
    t, square = lag[inside], displacement[inside]
    slope, offset = _line(t, square)
    exponent, _ = _line(np.log(t), np.log(square))
    return Regime(window[0], window[1], exponent / 2, slope / 2, offset)


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Slope and offset of the line that fits best."""
    about = x - x.mean()
    slope = float(about @ y / (about @ about))
    return slope, float(y.mean() - slope * x.mean())


FEWEST = 20  # rows below which there is nothing to measure
SLOPE = (0.1, 0.7)  # Hz
FEWEST_LINES = 4  # of the spectrum in that band, below which there is no slope
SEGMENTS = 2  # lengths of a segment of the spectrum in the record


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


def frequencies(frequency: Array, power: Array, band: tuple[float, float] = (0.0, np.inf)) -> Frequencies:
    """Distribution of the power of a spectrum over frequency, by the trapezoidal rule; NaN without power.

    Args:
        frequency: [Hz], rising, shape (F,).
        power: density, shape (F,).
        band: what of it counts [Hz], both ends included.

    Raises:
        DataError: if fewer than two lines are in the band.
    """
    if between(frequency, *band).sum() < 2:
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
    if between(f[low], *SLOPE).sum() < FEWEST_LINES:
        return np.nan
    return float(np.polynomial.polynomial.polyfit(np.log(f[low]), np.log(P[low]), 1, w=np.sqrt(weight[low]))[1])


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
