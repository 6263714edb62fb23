"""Measures of sway, as used in posturography for the centre of pressure (definitions, sources: docs/measures.md)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from icmj.base.array import RELATIVE_ROUNDING, Array, is_between
from icmj.base.card import Card, WithCard
from icmj.base.numbers import amount
from icmj.errors import DataError
from icmj.measurement.measure import Measure, Number, Of, Signal
from icmj.measurement.measures import choose_measures, numbers_of
from icmj.measurement.statistics import Spectrum, level_still, spectrum
from icmj.series.even_rows import resample_series
from icmj.series.series import Series
from icmj.series.units import convert_to_si

FEWEST = 20  # rows below which there is nothing to measure
SEGMENTS = 2  # lengths of a segment of the spectrum in the record
BEST_KNOWN = ("rms", "speed", "frequency.median")
"""Keys of the numbers of a coordinate that are shown where there is room for few."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What is measured of a coordinate, or of two together; each value is an attribute, such as ``rms``.

    Attributes:
        unit: unit of the coordinate.
        measures: what was measured.
        values: the values by name of the measure, such as ``rms`` or ``diffusion``.
    """

    unit: str
    measures: tuple[Measure, ...]
    values: Mapping[str, Any]

    def __getattr__(self, name: str) -> Any:
        values = vars(self).get("values", {})  # none yet where it is being copied
        if name in values:
            return values[name]
        raise AttributeError(f"{type(self).__name__} has no {name!r}")

    @cached_property
    def numbers(self) -> Mapping[Number, float]:
        """Every number with its value; NaN if the record was too short for it."""
        return {number: number.read(self.values[one.name]) for one in self.measures for number in one.numbers}

    def number(self, key: str) -> float:
        """The number of this key, such as ``frequency.median``; NaN without it."""
        return next((value for number, value in self.numbers.items() if number.key == key), float("nan"))

    def record(self) -> dict[str, Any]:
        """The values by name, as records hold them."""
        return {name: value.facts() if hasattr(value, "facts") else value for name, value in self.values.items()}


@dataclass(frozen=True, eq=False)
class Coordinate(Measured):
    """Measures of one coordinate, about its mean.

    Attributes:
        name: name of the coordinate.
    """

    name: str


@dataclass(frozen=True, eq=False)
class Plane(Measured):
    """Measures of two coordinates together.

    Attributes:
        names: names of the coordinates.
    """

    names: tuple[str, str]


@dataclass(frozen=True, eq=False, repr=False)
class Sway(WithCard):
    """Measures of a swaying point, or of any signals.

    Attributes:
        series: the evaluated series: evenly sampled, and filtered if requested.
        duration: N / rate [s].
        rate: samples per second [Hz].
        low_pass: cut-off frequency of the filter that is applied before all measures [Hz], or ``None``.
        coordinates: the measures of each signal.
        plane: the measures of two signals with the same unit together, otherwise ``None``.
        spectrum: spectrum of every signal.
    """

    series: Series
    duration: float
    rate: float
    low_pass: float | None
    coordinates: tuple[Coordinate, ...]
    plane: Plane | None
    spectrum: Spectrum

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook: the best-known measures."""
        rows: list[tuple[str, str]] = []
        for c in self.coordinates:
            shown = (one for key in BEST_KNOWN for one in c.numbers if one.key == key)
            rows += [(f"{c.name}, {one.words}", amount(c.numbers[one], _unit(one, c.unit), 4)) for one in shown]
        if self.plane is not None:
            known = {one.key: (value, _unit(one, self.plane.unit)) for one, value in self.plane.numbers.items()}
            labels = {"ellipse.area": "95 % prediction ellipse", "speed": "mean speed in the plane"}
            rows += [(words, amount(*known[key], 4)) for key, words in labels.items() if key in known]
        names = ", ".join(c.name for c in self.coordinates)
        return Card(f"{names}, {self.duration:.6g} s at {self.rate:.6g} Hz", tuple(rows))


def measure_sway(
    series: Series,
    columns: Sequence[str] = (),
    *,
    rate: float | None = None,
    low_pass: float | None = None,
    measures: Iterable[Measure | str] = (),
    **options: Any,
) -> Sway:
    """Measure the sway of some signals; two signals with the same unit are also measured as a point in a plane.

    Args:
        series: for example from :func:`icmj.read_series` or ``Result.to_series``.
        columns: names of the signals to measure; by default all.
        rate: rate to which the series is resampled by a cubic spline [Hz]; by default its own rate.
        low_pass: cut-off frequency [Hz], at which the gain is 1/√2, of a Butterworth filter of second order that is run
            forward and backward: of fourth order together, without phase shift. Between one period in the record and
            half the rate; by default there is no filter.
        measures: further measures beside the standard ones: names of the list (:mod:`icmj.measurement.measures`), or
            your own, made by :func:`icmj.measurement.define_measure`.
        options: those of the measures: ``band``, a pair of frequencies [Hz], for mean, median and edge frequency;
            Prieto et al. used 0.15 to 5 Hz.

    Raises:
        DataError: if there is no such signal, values are missing, there are gaps or too few rows, filter or band does
            not fit the rate, or a measure or an option is unknown.
        RunFileError: if a measure of your own fails.
    """
    series = resample_series(series.chosen(columns) if columns else series, rate)
    N = len(series)
    if N < FEWEST:
        raise DataError(f"{N} rows; expected at least {FEWEST}")
    step = float(series.t[-1] - series.t[0]) / (N - 1)
    chosen = choose_measures(measures, options)
    if low_pass is not None:
        series = replace(series, values=_filter(series.values, low_pass, 1 / step))
    series = replace(series, values=level_still(series.values))
    found = spectrum(series.t, series.values, SEGMENTS)
    coordinates = tuple(
        Coordinate(unit, *_apply(chosen, "coordinate", Signal(values, step, found.frequency, power)), name)
        for name, unit, values, power in zip(series.names, series.units, series.values.T, found.power.T, strict=True)
    )
    plane = None
    if len(coordinates) == 2 and len(set(series.units)) == 1:
        both, (first, second) = Signal(series.values, step, found.frequency, found.power.sum(axis=1)), series.names
        plane = Plane(series.units[0], *_apply(chosen, "plane", both), (first, second))
    return Sway(series, N * step, 1 / step, low_pass, coordinates, plane, found)


def sway_numbers(series: Series, low_pass: float | None = None, measures: Sequence[Measure] = ()) -> dict[str, Array]:
    """Measures of sway by signal and key, such as ``trunk.frequency.median``; NaN of a run that was too short."""
    if len(series) < FEWEST:
        numbers = numbers_of("coordinate", measures)
        return {f"{name}.{number.key}": np.asarray(np.nan) for name in series.names for number in numbers}
    found = measure_sway(series, low_pass=low_pass, measures=measures).coordinates
    return {f"{of.name}.{number.key}": np.asarray(value) for of in found for number, value in of.numbers.items()}


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
    moment = convert_to_si(series.chosen([torque]), "torque")
    return replace(moment, values=-moment.values / weight, names=("cop",), units=("m",))


def _apply(chosen: Sequence[Measure], of: Of, signal: Signal) -> tuple[tuple[Measure, ...], dict[str, Any]]:
    """Those that are measures of this, and their values by name."""
    those = tuple(one for one in chosen if of in one.of)
    return those, {one.name: one.measure(signal) for one in those}


def _unit(number: Number, unit: str) -> str:
    """The unit of a number for a prompt; without one where it has that of a coordinate without unit."""
    return number.unit_of(unit) if unit or "U" not in number.unit else ""


def _filter(values: Array, corner: float, rate: float) -> Array:
    from scipy.signal import butter, sosfiltfilt

    lowest = rate / len(values)  # beneath one period in the record nothing is left, and the filter's poles round to 1
    if not (is_between(corner, lowest) and corner < (1 - RELATIVE_ROUNDING) * rate / 2):
        raise DataError(
            f"a low-pass of {corner:g} Hz; expected from {lowest:.3g} Hz, one period in the record, to below half the "
            f"rate, {rate / 2:g} Hz"
        )
    # that of each pass is higher: of their gains, 1/√(1 + (Ω/Ω_c)⁴), the product is to be 1/√2 at the corner
    once = float(np.arctan(np.tan(np.pi * corner / rate) / (np.sqrt(2) - 1) ** 0.25)) * rate / np.pi
    return np.asarray(sosfiltfilt(butter(2, once, fs=rate, output="sos"), values, axis=0), float)
