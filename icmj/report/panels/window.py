"""What the panels share: the latter part of a run, the predicted orbit laid beside it, and degrees."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.result.result import Result

Signal = TypeVar("Signal", NDArray[np.float64], NDArray[np.complex128])

DEGREES = 180 / np.pi


def latter_part(result: Result, intervals: int) -> tuple[float, float]:
    """Start and end [s] of the last ``intervals`` open-loop intervals; the last third where there are too few."""
    simulation = result.simulation
    end = float(simulation.t[-1])
    events = simulation.events.t
    if len(events) > intervals:
        return float(events[-1 - intervals]), end
    return end - (end - float(simulation.t[0])) / 3, end


def orbit_sign(result: Result) -> float:
    """Which of the two predicted orbits ±X̄(t) the run is on just after its last event (+1 or −1)."""
    orbit, events = result.prediction.orbit, result.simulation.events
    if orbit is None or not len(events):
        return 1.0
    return 1.0 if float(events.x[-1] @ orbit.x_bar[: events.x.shape[1]]) >= 0 else -1.0


def repeated_orbit(result: Result, values: Signal, start: float, end: float) -> tuple[Array, Signal]:
    """An orbit signal repeated over [start, end] in step with the run's last event.

    Args:
        values: the signal over one interval, at ``orbit.t``; shape (M,) or (M, q).

    Returns:
        Times [s] and values; a NaN row parts the intervals.
    """
    orbit = result.prediction.orbit
    assert orbit is not None
    last = float(result.simulation.events.t[-1])
    first, after = int(np.floor((start - last) / orbit.delta)), int(np.ceil((end - last) / orbit.delta))
    t, v = [], []
    sign = orbit_sign(result)
    for i in range(first, after):
        t.append(np.append(last + i * orbit.delta + orbit.t, np.nan))
        signed = sign * values * (orbit.sign if i % 2 else 1)
        v.append(np.concatenate([signed, np.full((1, *values.shape[1:]), np.nan)]))
    if not t:
        return np.zeros(0), np.zeros((0, *values.shape[1:]))
    times, signal = np.concatenate(t), np.concatenate(v)
    keep = np.isnan(times) | ((times >= start) & (times <= end))
    return times[keep], signal[keep]
