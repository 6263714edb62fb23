"""The embedded Runge–Kutta method of order 8 that steps are adapted with, and its dense output of order 7.

Dormand and Prince's DOP853 with the error estimate of Hairer, Nørsett and Wanner (Solving Ordinary Differential
Equations I, II.5 and II.6); the coefficients are those that SciPy carries.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from icmj.base.array import Array

STAGES, EXTENDED, POWER, ORDER = 12, 16, 7, 8
GROWTH, SHRINKAGE, SAFETY = 6.0, 0.2, 0.9
SAMPLES = 8  # of the outputs in every step, from which their extremes are found
SHORTEST = 1e-11  # s; a step that has to be shorter meets something that is not smooth
NUDGE = 1e-4  # an event is polished by steps of so many times the loop's shortest time constant, or less
CALIBRATION = 5.0
"""Local error allowed in a step, relative to the motion, over the error of an interval asked for."""


class Tableau(NamedTuple):
    """Coefficients as arrays, which compiled code takes.

    Attributes:
        A, c: of the stages and of the three more for dense output, shapes (16, 16), (16,). Row 12 is the weights b.
        E3, E5: of the two error estimates, shape (13,).
        D: of the dense output's last four vectors, shape (4, 16).
        powers: of the dense output's seven basis functions, shape (7, 8).
    """

    A: Array
    c: Array
    E3: Array
    E5: Array
    D: Array
    powers: Array


@cache
def tableau() -> Tableau:
    """The method."""
    from scipy.integrate import DOP853

    A, c = np.zeros((EXTENDED, EXTENDED)), np.zeros(EXTENDED)
    A[:STAGES, :STAGES], c[:STAGES] = DOP853.A, DOP853.C
    A[STAGES, :STAGES], c[STAGES] = DOP853.B, 1.0
    A[STAGES + 1 :], c[STAGES + 1 :] = DOP853.A_EXTRA, DOP853.C_EXTRA
    powers, basis = np.zeros((POWER, POWER + 1)), Polynomial([1.0])
    for k in range(POWER):
        basis = basis * (Polynomial([0.0, 1.0]) if k % 2 == 0 else Polynomial([1.0, -1.0]))
        powers[k, : k + 2] = basis.coef
    return Tableau(A, c, np.array(DOP853.E3), np.array(DOP853.E5), np.array(DOP853.D), powers)


def dense(start: Array, K: Array, step: float, end: Array) -> Array:
    """The seven vectors of the dense output of a step from ``start`` to ``end``, shape (7, n), from all 16 rates."""
    moved = end - start
    ends = moved, step * K[0] - moved, 2 * moved - step * (K[STAGES] + K[0])
    return np.vstack([*ends, step * (tableau().D @ K)])


def within(start: Array, F: Array, theta: float) -> Array:
    """The state at the fraction ``theta`` of a step, from its dense output."""
    value = np.zeros_like(start)
    for k in range(POWER - 1, -1, -1):
        value = (value + F[k]) * (theta if k % 2 == 0 else 1 - theta)
    return start + value


def error_norm(K: Array, step: float, scale: Array) -> float:
    """The estimated error of a step in units of ``scale``, root mean square over the state."""
    weights = tableau()
    e5, e3 = (float(np.mean((E @ K[: STAGES + 1] / scale) ** 2)) for E in (weights.E5, weights.E3))
    return abs(step) * e5 / np.sqrt(e5 + 0.01 * e3) if e5 + e3 > 0 else 0.0 * (e5 + e3)


def rounded(step: float) -> float:
    """The step, down to five binary digits: error estimates carry rounding errors, which must not show in the step."""
    mantissa, exponent = math.frexp(step)
    return math.ldexp(math.floor(mantissa * 32) / 32, exponent)
