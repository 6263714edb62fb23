"""Sinusoids in windows, added to polynomials in time, in compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.compilation import compiled


class Waves(NamedTuple):
    """Sinusoids a cos(ωt + φ) in windows.

    Attributes:
        effect: what each does, per unit of its size, shape (K, rows).
        terms: (a, ω, φ, start, end) of each, shape (K, 5).
    """

    effect: Array
    terms: Array


@compiled
def add_waves(waves, t, end, unit, out):  # type: ignore[no-untyped-def]
    """Add to ``out``, shape (rows, p + 1), what these sinusoids do from ``t`` to ``end``."""
    middle = (t + end) / 2
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
