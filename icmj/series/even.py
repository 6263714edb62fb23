"""Resampling to even times: recorded times are only nearly even, and rows at events are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from icmj.base.array import Array
from icmj.errors import DataError
from icmj.series.series import EVEN, Series

MOST_ROWS = 5e6  # of an even series; measuring two signals of so many takes a gigabyte and a half
LARGEST, LONGEST = 1e50, 1e12  # of a value, whatever its unit; of a step [s], and of its inverse
GAP = 2.5  # steps: a distance between rows beyond which nobody knows what was there
_SAME = 1e-9  # of a step: what rounding leaves between two times
_ROUGH = 0.25  # of a step: rounding to few digits leaves the mean rate as it is; a lost row moves others by half a step
_CLOSE = 0.1  # of the usual distance between rows: one this close to the row before it adds nothing but rounding


def evenly(t: Array, values: Array, step: float | None = None) -> tuple[Array, Array]:
    """Smooth signals at even times, by a cubic spline through their rows.

    Args:
        t: times of the rows [s], rising, shape (N,), N > 1.
        values: shape (N, w).
        step: between the times [s]; the usual distance of the rows by default, and where most crowd in few places
            (events without a least interval) a tenth of the mean one.

    Returns:
        times (M,) and values (M, w).
    """
    from scipy.interpolate import CubicSpline

    usual = max(float(np.median(np.diff(t))), float(t[-1] - t[0]) / (10 * len(t)))
    step = usual if step is None else step
    kept = np.concatenate([[True], np.diff(t) > _CLOSE * usual])
    even = t[0] + step * np.arange(int((t[kept][-1] - t[0]) / step + EVEN) + 1)
    if len(even) == len(t) and np.abs(even - t).max() <= _SAME * step:
        return even, values
    return even, CubicSpline(t[kept], values[kept])(even)


def even_series(series: Series, rate: float | None = None) -> Series:
    """``series`` at even times: as it is where its times are even already, else by a cubic spline through its rows.

    Args:
        series: its values may not be missing.
        rate: rows per second [Hz]; that of the rows by default.

    Returns:
        The series, and among its facts ``resampled`` where it was.

    Raises:
        DataError: if values are missing, rows are too few, there is a gap between them, or the rate is unusable.
    """
    check_complete(series)
    steps = np.diff(series.t)
    usual = float(np.median(steps))
    widest = int(steps.argmax())
    if steps[widest] > GAP * usual:
        raise DataError(
            f"a gap of {steps[widest]:.4g} s after {series.t[widest]:.6g} s, where rows are {usual:.4g} s apart; "
            "measure a part without gaps"
        )
    # the mean step is better known than any single one
    mean = float(series.t[-1] - series.t[0]) / (len(series) - 1)
    off = np.abs(series.t - (series.t[0] + mean * np.arange(len(series)))).max()
    own = mean if off <= _ROUGH * mean else usual
    step = own if rate is None else step_of(rate, float(series.t[-1] - series.t[0]))
    if off <= EVEN * mean and abs(step - mean) * (len(series) - 1) <= EVEN * max(step, mean):
        return replace(series, t=series.t[0] + mean * np.arange(len(series)))
    t, values = evenly(series.t, series.values, step)
    return replace(
        series, t=t, values=values, facts={**series.facts, "resampled": f"cubic spline at {1 / step:.6g} Hz"}
    )


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
            raise DataError(
                f"{name}: {len(missing)} of {len(column)} values are missing or not finite, the first at "
                f"{series.t[missing[0]]:.6g} s; fill them or measure a part without them"
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
