"""Interpolation of piecewise smooth signals between recorded rows.

A controlled motion jumps, or bends, whenever new feedback, a delayed action or a push sets in. Across such an instant
nothing is interpolated: each piece between two of them has a cubic spline of its own (not-a-knot, so of fourth order in
the distance of the rows), which is extended to the piece's ends where there is no row.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from icmj.base.array import Array

_SAME = 1e-9  # [s]: a row this close to a break may be on either side of it
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
    """Interpolate piecewise smooth signals from their rows; at a break, the result is the value before it.

    Args:
        t: times of the rows [s], increasing, shape (N,).
        values: values of the signals at the rows, shape (N, w). A NaN affects the values up to the neighbouring rows.
        at: times of the result [s], increasing, from t[0] to t[-1], shape (M,).
        jumps: times of jumps at rows, which contain the values before the jump [s], shape (K,).
        after: values right after each jump, NaN if unknown, shape (K, w).
        breaks: further times of jumps, which need not be times of rows [s].

    Returns:
        The values at ``at``, shape (M, w).
    """
    jumps = np.zeros(0) if jumps is None else jumps
    after = np.full((len(jumps), values.shape[1]), np.nan) if after is None else after
    others = np.zeros(0) if breaks is None else np.asarray(breaks, float)
    others = others[[bool(np.all(np.abs(jumps - b) > _SAME)) for b in others]] if len(others) else others
    inner = np.unique(np.concatenate([jumps, others]))
    inner = inner[(inner > t[0]) & (inner < t[-1])]
    ends = np.concatenate([[-np.inf], inner, [np.inf]])
    usual = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    result = np.empty((len(at), values.shape[1]))
    for start, end in pairwise(ends):
        wanted = slice(*np.searchsorted(at, [start, end], side="right"))
        if wanted.start == wanted.stop:
            continue
        first = np.searchsorted(t, start + _SAME, side="right") if np.isfinite(start) else 0
        last = np.searchsorted(t, end - _SAME) if end in others else np.searchsorted(t, end, side="right")
        knots, rows = t[first:last], values[first:last]
        jump = np.flatnonzero(jumps == start)
        head = after[jump[0]] if len(jump) else np.full(values.shape[1], np.nan)
        known = np.isfinite(head)
        for columns, with_head in ((known, True), (~known, False)):
            if columns.any():
                times = np.concatenate([[start], knots]) if with_head else knots
                piece = np.vstack([head, rows])[:, columns] if with_head else rows[:, columns]
                kept = _apart(times, _CLOSE * usual)
                result[wanted, columns] = _smooth(times[kept], piece[kept], at[wanted], t, values[:, columns])
    return result


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
