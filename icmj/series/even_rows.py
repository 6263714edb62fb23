"""Resampling to even times: recorded times are only nearly even, and rows at events are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from icmj.base.array import Array
from icmj.base.numbers import count
from icmj.errors import DataError
from icmj.series.interpolation import CLOSE, piecewise
from icmj.series.series import EVEN, Series, is_steady

MOST_ROWS = 5e6  # of an even series; measuring two signals of so many takes a gigabyte and a half
LARGEST, LONGEST = 1e50, 1e12  # of a value, whatever its unit; of a step [s], and of its inverse
LONGEST_END = 0.5  # s that may be missing at an end; ours: within more, somebody may step on a plate
GAP = 2.5  # steps: a distance between rows beyond which nobody knows what was there
PASSED = 0.4  # of a lower rate, below which signals are taken over
_EDGE = 15  # rows by which a filter continues a record at its ends, SciPy's own number
_ROUGH = 0.25  # of a step: rounding to few digits leaves the mean rate as it is; a lost row moves others by half a step


def resample(t: Array, values: Array, step: float | None = None) -> tuple[Array, Array]:
    """Smooth signals at even times, by a cubic spline through their rows.

    Args:
        t: times of the rows [s], rising, shape (N,), N > 1.
        values: shape (N, w).
        step: between the times [s]; that of the rows by default (:func:`measure_row_step`).

    Returns:
        times (M,) and values (M, w).
    """
    from scipy.interpolate import CubicSpline

    usual = measure_row_step(t)
    step = usual if step is None else step
    kept = np.concatenate([[True], np.diff(t) > CLOSE * usual])
    even = t[0] + step * np.arange(int((t[kept][-1] - t[0]) / step + EVEN) + 1)
    if len(even) == len(t) and np.abs(even - t).max() <= EVEN * step:
        return even, values
    return even, CubicSpline(t[kept], values[kept])(even)


def measure_row_step(t: Array) -> float:
    """The step of rows [s], from as many of them as there are, because single times are rounded.

    Of rows that are even but for rounding, and for lost ones, it is what all take together; of others their usual
    distance, and where most crowd in few places (events without a least interval) a tenth of the mean one.

    Args:
        t: times [s], rising, shape (N,), N > 1.
    """
    span, usual = float(t[-1] - t[0]), float(np.median(np.diff(t)))
    for step in (span / (len(t) - 1), usual):
        place = np.rint((t - t[0]) / step)
        step = span / float(place[-1])
        if np.abs(t - t[0] - step * place).max() <= _ROUGH * step and np.diff(place).min() > 0:
            return step
    return max(usual, span / (10 * len(t)))


def expect_rate(series: Series, rate: float | None) -> Series:
    """The series, whose rows are as far apart as a rate that was said [Hz], if one was.

    Raises:
        DataError: if they are not, as the rate of a file with times is not for others to say.
    """
    own = 1 / measure_row_step(series.t) if len(series) > 1 else rate
    if rate is not None and own is not None and abs(own / rate - 1) > EVEN:
        raise DataError(f"has times, of {own:.6g} rows a second, where a rate of {rate:g} Hz was said; leave it out")
    return series


def resample_series(series: Series, rate: float | None = None) -> Series:
    """``series`` at even times: as it is where its times are even already, else by a cubic spline through its rows.

    Rows within half a second of its beginning or end in which values are missing are left out, which the fact ``ends``
    says; not so where nobody stands on a plate, as stepping on it is no sway.

    Of a run, by one spline for each open-loop interval. For a rate below that of its rows, what is faster than 0.4
    times the new rate is filtered out first, as it would appear as something slow (Butterworth, fourth order, run
    forward and backward); not so of a run, whose signals jump.

    Args:
        series: its values may not be missing elsewhere.
        rate: rows per second [Hz]; that of the rows by default.

    Returns:
        The series, and among its facts ``resampled`` where it was.

    Raises:
        DataError: if values are missing, rows are too few, there is a gap between them, or the rate is unusable.
    """
    series = _leave_out_ends(series)
    check_complete(series)
    steps = np.diff(series.t)
    usual = float(np.median(steps))
    widest = int(steps.argmax())
    if steps[widest] > GAP * usual:
        raise DataError(
            f"a gap of {steps[widest]:.4g} s after {series.t[widest]:.6g} s, where rows are {usual:.4g} s apart; "
            "measure a part without gaps"
        )
    mean = float(series.t[-1] - series.t[0]) / (len(series) - 1)
    off = np.abs(series.t - (series.t[0] + mean * np.arange(len(series)))).max()
    step = measure_row_step(series.t) if rate is None else step_of(rate, float(series.t[-1] - series.t[0]))
    if off <= EVEN * mean and abs(step - mean) * (len(series) - 1) <= EVEN * max(step, mean):
        return replace(series, t=series.t[0] + mean * np.arange(len(series)))
    slower = ""
    if len(series.jumps):
        t = series.t[0] + step * np.arange(int((series.t[-1] - series.t[0]) / step + EVEN) + 1)
        t = np.minimum(t, series.t[-1])
        values = piecewise(series.t, series.values, t, jumps=series.jumps, steady=is_steady(series.names))
    else:
        t, values, own = series.t, series.values, measure_row_step(series.t)
        if step > (1 + EVEN) * own:
            t, values = resample(t, values, own)
            values, slower = _hold_back(values, PASSED * own / step), f", below {PASSED / step:.4g} Hz"
        t, values = resample(t, values, step)
    facts = {**series.facts, "resampled": f"cubic spline at {1 / step:.6g} Hz{slower}"}
    return replace(series, t=t, values=values, facts=facts)


def _hold_back(values: Array, corner: float) -> Array:
    """Even signals without what is faster than ``corner``, in cycles a row."""
    from scipy.signal import butter, sosfiltfilt

    length = min(_EDGE, len(values) - 1)
    return np.asarray(sosfiltfilt(butter(4, corner, fs=1.0, output="sos"), values, axis=0, padlen=length), float)


def _leave_out_ends(series: Series) -> Series:
    missing = np.isnan(series.values)
    known = np.flatnonzero(~missing.any(axis=1))
    if not missing.any() or not len(known) or "load" in series.facts:
        return series
    first, last = known[0], known[-1]
    if max(series.t[first] - series.t[0], series.t[-1] - series.t[last]) > LONGEST_END:
        return series
    sides = (first, "at its beginning"), (len(series) - 1 - last, "at its end")
    ends = [f"{count(int(rows), 'row')} {where}" for rows, where in sides if rows]
    gone = np.r_[:first, last + 1 : len(series)]
    names = [name for name, lost in zip(series.names, missing[gone].T, strict=True) if lost.any()]
    said = f"left out: {' and '.join(ends)}, where {', '.join(names)} has no value"
    kept = replace(series, t=series.t[first : last + 1], values=series.values[first : last + 1])
    return replace(kept, facts={**series.facts, "ends": said}) if ends else series


def check_complete(series: Series, fewest: int = 2) -> None:
    """Check that there are rows with a finite number for every signal.

    Raises:
        DataError: if not.
    """
    if len(series) < fewest:
        raise DataError(f"{len(series)} rows; expected at least {fewest}")
    for name, column in zip(series.names, series.values.T, strict=True):
        missing = np.flatnonzero(~np.isfinite(column))
        if len(missing):
            why = f"; {series.facts['load']}" if "load" in series.facts else ""
            raise DataError(
                f"{name}: {len(missing)} of {len(column)} values are missing or not finite, the first at "
                f"{series.t[missing[0]]:.6g} s{why}; fill them or measure a part without them"
            )
        if (largest := np.abs(column).max()) > LARGEST:
            raise DataError(f"{name}: has a value of {largest:.2g}; expected at most {LARGEST:g}, whatever its unit")
    steps = np.diff(series.t)
    if len(steps) and not (np.median(steps) > 1 / LONGEST and steps.max() < LONGEST):
        raise DataError(f"rows are {steps.min():.2g} to {steps.max():.2g} s apart; are the times in seconds?")


def step_of(rate: float, duration: float) -> float:
    """The step [s] of a rate [Hz].

    Raises:
        DataError: if it is no rate, or gives more rows than can be kept.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise DataError(f"a rate must be positive and finite, got {rate:g} Hz")
    if rate * duration > MOST_ROWS:
        raise DataError(
            f"{rate:g} Hz over {duration:.4g} s are {rate * duration:.2g} rows; expected at most {MOST_ROWS:.0e}"
        )
    return 1 / rate
