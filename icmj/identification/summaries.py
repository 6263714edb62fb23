"""Summary statistics by which a noisy motion is compared with simulated ones: a few, nearly normal."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array, between
from icmj.identification.observed import Observed

FEWEST = 8  # intervals
SKIPPED = 0.1  # part of the record at its begin that is left out, where a start may still be felt
_NEAR = 4.0  # standard deviations of the error of a time: an interval so near to the least one may be it
_LAGS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)


def summaries(observed: Observed, least: float, reference: float) -> Array | None:
    """The summary statistics of a noisy motion, or ``None`` if it is too short.

    Args:
        observed: the motion.
        least: the least interval, Δ_min or the delay [s].
        reference: an interval to take lags in units of [s].
    """
    return _of_samples(observed, reference) if len(observed.t) else _of_events(observed, least)


def _of_events(observed: Observed, least: float) -> Array | None:
    begin = observed.begin + SKIPPED * observed.duration
    kept = between(observed.times, begin)
    intervals = np.maximum(np.diff(observed.times[kept]), 1e-9)
    if len(intervals) < FEWEST:
        return None
    log = np.log(intervals)
    free = intervals > least * (1 + 1e-6) + _NEAR * observed.jitter
    told = [log.mean(), np.log(log.std() + 1e-3), np.arcsin(np.sqrt(1 - free.mean())), _lagged(log)]
    outputs = observed.outputs[kept]
    for y in outputs.T:
        together = np.sum(y[1:] * y[:-1]) / max(np.sqrt(np.sum(y[1:] ** 2) * np.sum(y[:-1] ** 2)), 1e-300)
        told += [np.log(np.sqrt(np.mean(y**2)) + 1e-300), np.arctanh(0.99 * together)]
    return np.array(told)


def _of_samples(observed: Observed, reference: float) -> Array | None:
    kept = between(observed.t, observed.t[0] + SKIPPED * (observed.t[-1] - observed.t[0]))
    t, y = observed.t[kept], observed.y[kept]
    if t[-1] - t[0] < 4 * reference:
        return None
    told: list[float] = []
    for column in y.T:
        column = column - column.mean()
        size = np.sqrt(np.mean(column**2))
        told.append(float(np.log(size + 1e-300)))
        for lag in _LAGS:
            ahead = t + lag * reference
            later = np.interp(ahead[between(ahead, t[0], t[-1])], t, column)
            told.append(float(np.mean(later * column[: len(later)]) / max(size**2, 1e-300)))
    return np.array(told)


def _lagged(values: Array) -> float:
    centred = values - values.mean()
    return float(np.mean(centred[1:] * centred[:-1]) / max(np.mean(centred**2), 1e-300))
