"""Interpolation of piecewise smooth signals between recorded rows.

A controlled motion jumps, or bends, whenever new feedback, a delayed action or a push sets in. Across such an instant
nothing is interpolated: each piece between two of them has a cubic spline of its own (not-a-knot, so of fourth order in
the distance of the rows), which is extended to the piece's ends where there is no row.

At the instant itself one side is given, the same as in a row there: at an event the value before the reset, which
belongs to the interval that ends; at any other break the value from there on.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from icmj.base.array import Array

NEAR = 1e-9  # [s]: instants this close are one
_CLOSE = 0.1  # of the usual distance between rows: one this close to another only magnifies rounding


def piecewise(
    t: Array,
    values: Array,
    at: Array,
    *,
    jumps: Array | None = None,
    after: Array | None = None,
    breaks: Array | None = None,
) -> Array:
    """Interpolate piecewise smooth signals from their rows, whose values are given where there is one.

    Args:
        t: times of the rows [s], increasing, shape (N,).
        values: values of the signals at the rows, shape (N, w). A NaN affects the values up to the neighbouring rows.
        at: times of the result [s], increasing, from t[0] to t[-1], shape (M,).
        jumps: times of jumps at rows, which contain the values before the jump [s], shape (K,).
        after: values right after each jump, NaN if unknown, shape (K, w).
        breaks: further times of jumps, which need not be times of rows [s]; a row there contains the values after it.

    Returns:
        The values at ``at``, shape (M, w).
    """
    # of rows at one instant but for rounding the last tells what is there
    kept = np.append(np.diff(t) > NEAR, True)
    t, values = t[kept], values[kept]
    jumps = np.zeros(0) if jumps is None else jumps
    after = np.full((len(jumps), values.shape[1]), np.nan) if after is None else after
    breaks = np.zeros(0) if breaks is None else np.asarray(breaks, float)
    # what jumps at a break, too, is in the row of the jump already: that row tells nothing of the time before
    shared = _near(jumps, breaks)
    inner = np.concatenate([jumps, _apart_from(np.unique(breaks[~_near(breaks, jumps)]))])
    kind = np.concatenate([np.arange(len(jumps)), np.full(len(inner) - len(jumps), -1)])
    order = np.argsort(inner, kind="stable")
    order = order[(inner[order] > t[0]) & (inner[order] < t[-1])]
    inner, kind = inner[order], kind[order]
    # of its results and rows, those at a jump belong to the piece before it, and those at a break to the one after
    side = np.where(kind >= 0, NEAR, -NEAR)
    cuts = [np.concatenate([[0], np.searchsorted(times, inner + side), [len(times)]]) for times in (at, t)]
    usual = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    result = np.empty((len(at), values.shape[1]))
    for number, (here, there) in enumerate(zip(pairwise(cuts[0]), pairwise(cuts[1]), strict=True)):
        if here[0] >= here[1]:
            continue
        begin, end = kind[number - 1] if number else -1, kind[number] if number < len(kind) else -1
        wanted, last = slice(*here), there[1] - 1 if end >= 0 and shared[end] else there[1]
        knots, rows = t[there[0] : last], values[there[0] : last]
        head = after[begin] if begin >= 0 else np.full(values.shape[1], np.nan)
        known = np.isfinite(head)
        for columns, with_head in ((known, True), (~known, False)):
            if columns.any():
                times = np.concatenate([[jumps[begin]], knots]) if with_head else knots
                piece = np.vstack([head, rows])[:, columns] if with_head else rows[:, columns]
                apart = _apart(times, _CLOSE * usual)
                result[wanted, columns] = _smooth(times[apart], piece[apart], at[wanted], t, values[:, columns])
    row = np.minimum(np.searchsorted(t, at - NEAR), len(t) - 1)
    met = np.abs(t[row] - at) <= NEAR
    result[met] = values[row[met]]
    return result


def _near(times: Array, others: Array) -> np.ndarray:
    """Mask of the times at which there is one of the others, shape (N,), bool."""
    others = np.sort(others)
    return np.searchsorted(others, times + NEAR, side="right") > np.searchsorted(others, times - NEAR)


def _apart_from(times: Array) -> Array:
    """The first of all increasing times that are one."""
    return times[np.diff(times, prepend=-np.inf) > NEAR]


def _smooth(knots: Array, piece: Array, at: Array, t: Array, values: Array) -> Array:
    """A spline through the knots of one piece; straight lines between all rows where it has none, or NaN."""
    from scipy.interpolate import CubicSpline

    result = np.empty((len(at), piece.shape[1]))
    good = np.isfinite(piece).all(axis=0) & (len(knots) > 1)
    if good.any():
        result[:, good] = CubicSpline(knots, piece[:, good])(at)
    for i in np.flatnonzero(~good):
        result[:, i] = np.interp(at, knots, piece[:, i]) if len(knots) > 1 else np.interp(at, t, values[:, i])
    return result


def _apart(times: Array, least: float) -> Array:
    """Mask of times of which no two are closer than ``least``; the first and last are kept; shape (N,), bool."""
    kept = np.ones(len(times), dtype=bool)
    if len(times) > 2:
        kept[1:-1] = (np.diff(times)[:-1] >= least) & (times[-1] - times[1:-1] >= least)
    return kept
