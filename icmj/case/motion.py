"""A motion in the quantities that pictures show.

Outputs against their rates, the state x̄ and its modes χ, upright jumps at the resets, and the inputs on which something
else acts than the command.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import Array, is_between
from icmj.case.result import Result
from icmj.measurement.measurement import reduced_states
from icmj.plant.linear_plant import transformation
from icmj.series.interpolation import NEAR, piecewise
from icmj.simulation.simulation import Simulation

SMOOTH = 1 / 4000  # of the range: so far a line between points may be off the curve, a tenth of a pixel in 400
MOST = 32  # points between two rows


def output_rate(result: Result, x: Array, u: Array) -> Array:
    """ẏ = C(Ax + Bu) of the linearised actual plant; shapes (..., n), (..., n_u) → (..., n_y)."""
    plant = result.actual
    return x @ (plant.C @ plant.A).T + u @ (plant.C @ plant.B).T


def curve(result: Result, start: float, end: float) -> tuple[Array, Array]:
    """Outputs and their rates from ``start`` to ``end`` [s], so dense that a line through the points is a smooth curve.

    Between rows they are interpolated by splines of the pieces between events, actions and pushes, of fourth order in
    the distance of the rows. Two rows have as many points between them as the bend there needs.

    Returns:
        y and ẏ, shapes (M, n_y); those of the rows alone where a value is not finite.
    """
    run, n_y = result.simulation, result.actual.n_y
    began = run.events.t[run.events.t < start - NEAR]
    rows = is_between(run.t, began[-1] if len(began) else run.t[0], end)
    t, values = run.t[rows], np.hstack([run.y, output_rate(result, run.x, run.u)])[rows]
    if len(t) > 1 and np.isfinite(values).all():
        t, values = _refine(result, t, values)
    late = is_between(t, start, end)
    t, values = t[late], values[late]
    # where an input acts on an output's rate at once, that jumps with it, and the curve has a gap
    jumping = np.flatnonzero(np.abs(result.actual.C @ result.actual.B).max(axis=1) > 0)
    if len(jumping):
        bends = np.unique(np.concatenate(run.breaks))
        gaps = np.unique(np.searchsorted(t, bends[is_between(bends, start, end)] + NEAR))
        gaps = gaps[(gaps > 0) & (gaps < len(t))]
        gap = values[gaps - 1]
        gap[:, n_y + jumping] = np.nan
        values = np.insert(values, gaps, gap, axis=0)
    return values[:, :n_y], values[:, n_y:]


def _refine(result: Result, t: Array, values: Array) -> tuple[Array, Array]:
    """Rows of outputs and rates with what is between them, in as many points as a smooth curve needs."""
    plant, n_y = result.actual, result.actual.n_y
    resets, others = result.simulation.breaks
    # where an input acts on an output's rate at once, that jumps with it
    steady = np.arange(2 * n_y) < (n_y if (plant.C @ plant.B).any() else 2 * n_y)

    def at(times: Array) -> Array:
        return piecewise(t, values, times, jumps=resets[is_between(resets, t[0], t[-1])], breaks=others, steady=steady)

    middle, extent = at((t[1:] + t[:-1]) / 2), np.ptp(values, axis=0)
    off = np.abs(middle - (values[1:] + values[:-1]) / 2) / np.where(extent > 0, extent, 1)
    # the distance from a chord falls with the square of its length
    count = np.clip(np.ceil(np.sqrt(off.max(axis=1) / SMOOTH)), 1, MOST).astype(int)
    part = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    times = np.append(np.repeat(t[:-1], count) + np.repeat(np.diff(t) / count, count) * part, t[-1])
    return times, at(times)


def reduce_state(result: Result, x: Array, x_o: Array, x_h: Array) -> Array:
    """x̄ = (x, x_o − T̂x), from event to event the whole state; shapes (..., n), (..., n̂), (..., n̂) → (..., n + n̂).

    With a delay x_h − T̂x belongs to it: (..., n + 2n̂).
    """
    delayed = x_h if result.simulation.delay else None
    return reduced_states(x, x_o, transformation(result.assumed, result.actual), delayed)


def modes(result: Result, x_bar: Array) -> NDArray[np.complex128]:
    """χ = V⁻¹x̄ (eq. chi), the critical mode first; shape (..., n + n̂). Only where the prediction has V⁻¹.

    A mode is real if its eigenvalue is, as the critical one is; of a complex pair the real part is one phase.
    """
    V_inv = result.expect_prediction().V_inv
    assert V_inv is not None
    return x_bar @ V_inv.T


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


def acting(result: Result) -> list[int]:
    """Indices of the inputs where ``applied`` is not ``u``; a difference by rounding is none."""
    simulation = result.simulation
    if not simulation.applied.size:
        return []
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(simulation.applied - simulation.u)
        differs = (apart > 1e-9 * np.abs(simulation.u)) & (apart > 1e-9 * np.nanmax(apart, initial=0.0))
    return [int(i) for i in np.flatnonzero(differs.any(axis=0))]
