"""The time of a run as pictures need it: its rows at events, its latter part, and upright jumps at the resets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array
from icmj.simulation.simulation import Simulation


def event_rows(simulation: Simulation) -> NDArray[np.intp]:
    """Indices of the rows at the events, which hold the values before the reset; shape (K,)."""
    return np.searchsorted(simulation.t, simulation.events.t)


def latter_part(simulation: Simulation, intervals: int) -> tuple[float, float]:
    """Start and end [s] of the last ``intervals`` open-loop intervals; the last third where there are too few."""
    end = float(simulation.t[-1])
    events = simulation.events.t
    if len(events) > intervals:
        return float(events[-1 - intervals]), end
    return end - (end - float(simulation.t[0])) / 3, end


def with_resets(simulation: Simulation, values: Array, after: Array) -> tuple[Array, Array]:
    """Times and values of the rows (N, w) with the values (K, w) right after every event put in.

    A row at an event holds the value before the reset x_h := x_o; with the one after it, a jump is drawn upright.
    """
    at = simulation.events.t
    if not len(at) or simulation.delay:  # nothing is reset at an event whose action comes later
        return simulation.t, values
    place = np.searchsorted(simulation.t, at, side="right")
    return np.insert(simulation.t, place, at), np.insert(values, place, after, axis=0)


def running_interval(simulation: Simulation) -> tuple[Array, Array]:
    """Time since the last event, at every event before and after the reset: a sawtooth with vertical falls.

    Times and values [s], shape (2K + 2,).
    """
    events, end = simulation.events, float(simulation.t[-1])
    t = np.concatenate([[0.0], np.repeat(events.t, 2), [end]])
    since = np.concatenate([[0.0], np.column_stack([events.interval, 0 * events.t]).ravel(), [0.0]])
    since[-1] = end - (events.t[-1] if len(events) else 0.0)
    return t, since
