"""Interpolation of piecewise smooth signals between recorded rows.

A controlled motion jumps, or bends, whenever new feedback, a delayed action or a push sets in. Across such an instant
nothing is interpolated: each piece between two of them has a cubic spline of its own (not-a-knot, so of fourth order in
the distance of the rows), which is extended to the piece's ends where there is no row. At the instant itself one side
is given, the same as in a row there: at an event the value before the reset, at any other break the value after it.
"""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from icmj.base.array import Array

CLOSE = 0.1
"""Share of the usual distance between rows: one this close to the row before it adds nothing but rounding."""
NEAR = 1e-9  # [s]: instants this close are one


def piecewise(
    t: Array,
    values: Array,
    at: Array,
    *,
    jumps: Array | None = None,
    after: Array | None = None,
    breaks: Array | None = None,
    before: tuple[Array, Array] | None = None,
    bends: Array | None = None,
    steady: np.ndarray | None = None,
) -> Array:
    """Interpolate piecewise smooth signals from their rows, whose values are given where there is one.

    Args:
        t: times of the rows [s], increasing, shape (N,).
        values: values of the signals at the rows, shape (N, w). A NaN affects the values up to the neighbouring rows.
        at: times of the result [s], increasing, from t[0] to t[-1], shape (M,).
        jumps: times of jumps at rows, which contain the values before the jump [s], shape (K,).
        after: values right after each jump, NaN if unknown, shape (K, w).
        breaks: further times of jumps, which need not be times of rows [s]; a row there contains the values after it.
        before: of some of the breaks their times [s], rising, and the values right before them, NaN if unknown; shapes
            (S,), (S, w). Of a break at which there is a jump, too, the row tells only what is between the two.
        bends: times at which all signals bend and none jumps, so that a row is of both sides [s].
        steady: mask of the signals that bend at jumps and breaks, too, and do not jump; shape (w,).

    Returns:
        The values at ``at``, shape (M, w).
    """
    # of rows at one instant but for rounding the last tells what is there
    kept = np.append(np.diff(t) > NEAR, True)
    t, values = t[kept], values[kept]
    none = np.zeros(0)
    jumps, breaks, bends = (none if of is None else np.asarray(of, float) for of in (jumps, breaks, bends))
    after = np.full((len(jumps), values.shape[1]), np.nan) if after is None else after
    told, left = (none, np.zeros((0, values.shape[1]))) if before is None else before
    steady = np.zeros(values.shape[1], dtype=bool) if steady is None else steady
    result = np.empty((len(at), values.shape[1]))
    for these, instants in (
        (~steady, (jumps, after[:, ~steady], breaks, bends, (told, left[:, ~steady]))),
        (steady, (none, np.zeros((0, int(steady.sum()))), none, np.concatenate([jumps, breaks, bends]), None)),
    ):
        if these.any():
            result[:, these] = _by_pieces(t, values[:, these], at, *instants)
    row = np.minimum(np.searchsorted(t, at - NEAR), len(t) - 1)
    met = np.abs(t[row] - at) <= NEAR
    result[met] = values[row[met]]
    return result


_JUMP, _BREAK, _BEND = 0, 1, 2  # what a row tells there: the value before, after, or of both sides


def _by_pieces(
    t: Array,
    values: Array,
    at: Array,
    jumps: Array,
    after: Array,
    breaks: Array,
    bends: Array,
    before: tuple[Array, Array] | None,
) -> Array:
    """A spline for each piece between two instants, through the rows of its own side."""
    bends = _apart_from(np.unique(bends[~has_instants(bends, np.concatenate([jumps, breaks]))]))
    bends = bends[(bends > t[0] + NEAR) & (bends < t[-1] - NEAR)]
    alone = bends[~has_instants(bends, t)]
    if len(alone):  # without a row, as in logs of before: what is there is known from the piece before
        breaking = np.concatenate([breaks, bends])
        known = _by_pieces(t, values, alone - 2 * NEAR, jumps, after, breaking, bends[:0], before)
        place = np.searchsorted(t, alone)
        t, values = np.insert(t, place, alone), np.insert(values, place, known, axis=0)
    # what jumps at a break, too, is in the row of the jump already: only ``before`` tells of the time before
    shared = has_instants(jumps, breaks)
    breaks = _apart_from(np.unique(breaks[~has_instants(breaks, jumps)]))
    inner = np.concatenate([jumps, breaks, bends])
    kind = np.repeat([_JUMP, _BREAK, _BEND], [len(jumps), len(breaks), len(bends)])
    parted = np.concatenate([shared, np.ones(len(breaks), bool), np.zeros(len(bends), bool)])
    left = np.full((len(inner), values.shape[1]), np.nan)
    if before is not None and len(before[0]):
        place = np.minimum(np.searchsorted(before[0], inner - NEAR), len(before[0]) - 1)
        told = parted & (np.abs(before[0][place] - inner) <= NEAR)
        left[told] = before[1][place[told]]
    order = np.argsort(inner, kind="stable")
    order = order[(inner[order] > t[0]) & (inner[order] < t[-1] + NEAR)]
    inner, kind, apart = inner[order], kind[order], parted[order]
    early, late = (np.searchsorted(t, inner + side) for side in (-NEAR, NEAR))
    begins = np.append(0, np.where(kind == _JUMP, late, early))
    ends = np.append(np.where(apart, early, late), len(t))
    # after a jump without any row the next one is nearer than what was before, if what is right after it is not known
    empty = (begins == ends) & np.append(False, kind == _JUMP) & (np.append(late, 0) > np.append(early, 0))
    ends = np.where(empty, np.append(late, len(t)), ends)
    # where instants come faster than rows, a piece alone tells no slope, but rows of one side each are joined by lines
    single = (ends - begins == 1) & ~empty
    ends_it = single & np.append(np.abs(t[np.minimum(begins[:-1], len(t) - 1)] - inner) <= NEAR, True)
    beside = np.where(ends_it, np.append(False, single[:-1]), np.append(single[1:], False))
    dense = single & beside
    # of its results, those at a jump belong to the piece before it, and others to the one after
    cuts = np.concatenate([[0], np.searchsorted(at, inner + np.where(kind == _JUMP, NEAR, -NEAR)), [len(at)]])
    least = CLOSE * float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    result = np.empty((len(at), values.shape[1]))
    for number, wanted in enumerate(pairwise(cuts)):
        if wanted[0] >= wanted[1]:
            continue
        here = slice(*wanted)
        begun = number and kind[number - 1] == _JUMP
        head = after[order[number - 1]] if begun else np.full(values.shape[1], np.nan)
        tail = left[order[number]] if number < len(inner) else np.full(values.shape[1], np.nan)
        for with_head, with_tail in product((True, False), repeat=2):
            columns = (np.isfinite(head) == with_head) & (np.isfinite(tail) == with_tail)
            if columns.any():
                alone_there = empty[number] and (with_head or with_tail)
                rows = slice(begins[number], begins[number] if alone_there else ends[number])
                if dense[number] and not (with_head or with_tail):
                    rows = slice(rows.start - ends_it[number], rows.stop + (not ends_it[number]))
                first, last = inner[number - 1 : number][:with_head], inner[number : number + 1][:with_tail]
                times = np.concatenate([first, t[rows], last])
                through = np.vstack([*[head] * with_head, values[rows], *[tail] * with_tail])[:, columns]
                few = _apart(times, least)
                result[here, columns] = _smooth(times[few], through[few], at[here], t, values[:, columns])
    return result


def snap_rows(times: Array, instants: Array) -> Array:
    """Times of rows, of which one that is an instant but for rounding is exactly that; both rising."""
    if not len(instants):
        return times
    place = np.clip(np.searchsorted(instants, times - NEAR), 0, len(instants) - 1)
    return np.where(np.abs(instants[place] - times) <= NEAR, instants[place], times)


def has_instants(times: Array, others: Array) -> np.ndarray:
    """Mask of the times at which there is one of the others, shape (N,), bool."""
    others = np.sort(others)
    return np.searchsorted(others, times + NEAR, side="right") > np.searchsorted(others, times - NEAR)


def _apart_from(times: Array) -> Array:
    """The first of all increasing times that are one."""
    return times[np.diff(times, prepend=-np.inf) > NEAR]


def _smooth(knots: Array, piece: Array, at: Array, t: Array, values: Array) -> Array:
    """A spline through the knots of one piece, or the value of its only one.

    Where a value is NaN, straight lines through the knots; where there are none, between all rows.
    """
    from scipy.interpolate import CubicSpline

    result = np.empty((len(at), piece.shape[1]))
    good = np.isfinite(piece).all(axis=0) & (len(knots) > 1)
    if good.any():
        result[:, good] = CubicSpline(knots, piece[:, good])(at)
    for i in np.flatnonzero(~good):
        result[:, i] = np.interp(at, knots, piece[:, i]) if len(knots) else np.interp(at, t, values[:, i])
    return result


def _apart(times: Array, least: float) -> Array:
    """Mask of times of which no two are closer than ``least``; the first and last are kept; shape (N,), bool."""
    kept = np.ones(len(times), dtype=bool)
    if len(times) > 2:
        kept[1:-1] = (np.diff(times)[:-1] >= least) & (times[-1] - times[1:-1] >= least)
    return kept
