"""Exogenous inputs as *signals*, piecewise polynomials in time whose evaluation cost does not depend on the terms.

A signal is the sum of all terms a·cos(ω t + φ) that act in one place and in one window of time. On a cell around t_c,
2 Z/ω_max wide, a term is a·cos(θ + z x) with θ = ω t_c + φ, z ≤ Z and |x| ≤ 1, and its Taylor polynomial in x is right
to rounding. Its coefficients are cos θ, sin θ times *weights*, which are the same in all cells; so those of a cell
follow from the terms and its number alone, whoever asks first, and what a signal is worth at an instant is the same to
the last bit whatever the steps. Each signal keeps its latest cells, one in each of some places by its number. From cell
to cell the phases turn by ω times the width; in the first of every group of cells they are taken from ω and φ anew.

Gaussian noise (:mod:`icmj.simulation.settings`) is a signal, too: it goes straight from one value of its grid to the
next, and all its values are there from the start.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from icmj.base.array import Array
from icmj.simulation.grid import count_points, draw_at_points
from icmj.simulation.sources import Gridded

REACH = 2.0  # Z [rad]: the first power left out is below Z^24/24! = 3e-17 of the amplitude
HALF = 12  # coefficients of even powers, and of odd ones
KEPT = 8  # cells of a signal: the stages of a long step go back and forth
SIGNAL, WEIGHTS, PLACE = 6, 4 + 2 * HALF, 1 + 2 * HALF
CELL = 1 + KEPT * PLACE
FOREVER = 1e30  # s: the end of what does not end, and the longest cell of a constant


def sort_terms(table: Array) -> Array:
    """Terms as :class:`icmj.engine.block.Block` has them, those of one signal together."""
    return table[np.lexsort((table[:, 5], table[:, 4], table[:, 0]))]


def list_signals(table: Array, first: int) -> Array:
    """(place, start, end, first term, the one after the last, width of a cell [s]) of each signal, shape (S, 6).

    Of Gaussian noise (:func:`draw_signals`) the fourth is below zero: −1 less the number of its first value.

    ``table`` are :func:`sort_terms`, whose first one has the number ``first``.
    """
    places = table[:, [0, 4, 5]]
    begins = np.flatnonzero(np.r_[True, np.any(places[1:] != places[:-1], axis=1)][: len(table)])
    ends = np.r_[begins[1:], len(table)][: len(begins)].astype(int)
    fastest = np.array([np.abs(table[begin:end, 2]).max() for begin, end in zip(begins, ends, strict=True)])
    width = 2 * REACH / np.maximum(fastest, 2 * REACH / FOREVER)
    return np.column_stack([places[begins], first + begins, first + ends, width])


def compute_weights(terms: Array, signals: Array) -> Array:
    """What makes cells of the terms: 28 numbers of each term, those of a signal together, each number of all its terms.

    The numbers are room for cos θ and sin θ, cosine and sine of what θ turns by from cell to cell, coefficients of
    cos θ in the powers 0, 2, … of x, and of sin θ in 1, 3, ….
    """
    found, power = [np.zeros(0)], np.arange(2 * HALF)[:, None]
    sign, factor = np.array([1.0, -1.0, -1.0, 1.0])[power % 4], np.cumprod(np.maximum(power, 1.0), axis=0)
    for *_, first, last, width in signals[signals[:, 3] >= 0]:
        _, amplitude, omega, *_ = terms[int(first) : int(last)].T
        turn = omega * width
        series = amplitude * sign * (turn / 2) ** power / factor
        rows = np.vstack([np.zeros((2, len(turn))), np.cos(turn), np.sin(turn), series[::2], series[1::2]])
        found.append(rows.ravel())
    return np.concatenate(found)


def make_cells(signals: Array) -> Array:
    """Arrays for the cells of each signal: the cell whose phases are known, (number, coefficients) in each place."""
    cells = np.zeros((len(signals), CELL))
    cells[:, 0] = cells[:, 1::PLACE] = np.nan
    return cells


def draw_signals(noises: Sequence[tuple[int, float, Gridded]], first: int, duration: float) -> tuple[Array, Array]:
    """Signals of Gaussian noises, each (place, factor, noise), and their values over a run of ``duration`` [s].

    ``first`` is the number of values before them.

    Returns:
        shapes (S, 6) and (V,).
    """
    rows, values = [], [np.zeros(0)]
    for place, factor, noise in noises:
        drawn = factor * draw_at_points(noise, 0, count_points(noise, duration))
        begin = first + sum(map(len, values))
        rows.append((place, noise.start, FOREVER, -1 - begin, begin + len(drawn), noise.interval))
        values.append(drawn)
    return np.array(rows, dtype=float).reshape(-1, SIGNAL), np.concatenate(values)
