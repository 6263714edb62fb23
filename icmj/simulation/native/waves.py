"""Sinusoids in windows and Gaussian noise, added to polynomials in time, in compiled code."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import call, compiled, entry, hash_contents


class Waves(NamedTuple):
    """Sinusoids a cos(ωt + φ) in windows, and Gaussian noises.

    Attributes:
        effect: what each sinusoid does, per unit of its size, shape (K, rows).
        terms: (a, ω, φ, start, end) of each, shape (K, 5).
        through: what each noise does, per unit of its size, shape (G, rows).
        grids: (start, interval, first, last) of each noise: the range of its values; shape (G, 4).
        values: of all noises at the points of their grids.
    """

    effect: Array
    terms: Array
    through: Array = np.zeros((0, 0))
    grids: Array = np.zeros((0, 4))
    values: Array = np.zeros(0)


@compiled
def add_waves(waves, t, end, unit, out):  # type: ignore[no-untyped-def]
    """Add to ``out``, shape (rows, p + 1), what these do from ``t`` to ``end``, between two points of every grid."""
    middle = (t + end) / 2
    for k in range(len(waves.grids)):
        start, interval, first, last = waves.grids[k]
        if middle < start:
            continue
        point = min(np.floor(middle / interval), last - first - 2)
        at = int(first + point)
        slope = (waves.values[at + 1] - waves.values[at]) / interval
        value = waves.values[at] + (t - point * interval) * slope
        for i in range(len(out)):
            out[i, 0] += waves.through[k, i] * value
            out[i, 1] += waves.through[k, i] * slope * unit
    for k in range(len(waves.terms)):
        a, omega, phase = waves.terms[k, 0], waves.terms[k, 1], waves.terms[k, 2]
        if not waves.terms[k, 3] <= middle < waves.terms[k, 4]:
            continue
        turn, size = omega * unit, a
        cos, sin = np.cos(omega * t + phase), np.sin(omega * t + phase)
        for j in range(out.shape[1]):
            value = size * cos
            for i in range(len(out)):
                out[i, j] += waves.effect[k, i] * value
            if turn == 0:
                break
            size *= turn / (j + 1)
            cos, sin = -sin, cos


def turn(turns: Array, real: Array, imaginary: Array, out: Array) -> None:
    """``out`` := (real + i imaginary) times ``turns``, row by row, in one pass over memory.

    Args:
        turns, out: real and imaginary parts, shapes (2, K, at least as many columns) and (2, K, columns).
        real, imaginary: one number for each row, shape (K,).
    """
    call(_turn(), turns, real, imaginary, out)


@cache
def _turn() -> Any:
    source = hash_contents(Path(__file__).parent)

    @entry
    def turn(turns, real, imaginary, out):  # type: ignore[no-untyped-def]
        if source == 0:
            return
        for i in range(len(real)):
            a, b = real[i], imaginary[i]
            for k in range(out.shape[2]):
                out[0, i, k] = a * turns[0, i, k] - b * turns[1, i, k]
                out[1, i, k] = a * turns[1, i, k] + b * turns[0, i, k]

    return turn
