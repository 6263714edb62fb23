"""Averages of a correlated sequence, with their confidence from the averages of its blocks.

Successive values of a motion are not independent, so their scatter says little about the error of their mean. Averages
over blocks much longer than the motion's memory are nearly independent, and theirs does (batch means).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array

BLOCKS = 10


@dataclass(frozen=True)
class Estimate:
    """A number from a finite run.

    Attributes:
        value: the number.
        error: half the width of its 95 % confidence interval; NaN where the run is too short to tell.
    """

    value: float
    error: float


def mean(values: Array, blocks: int = BLOCKS) -> Estimate:
    """The mean of a sequence, shape (N,)."""
    return Estimate(float(values.mean()), half_width(_averages(values, blocks)))


def deviation(values: Array, blocks: int = BLOCKS) -> Estimate:
    """The standard deviation of a sequence, shape (N,); for a signal its RMS about the mean."""
    squares = (values - values.mean()) ** 2
    size = float(np.sqrt(squares.mean()))
    return Estimate(size, half_width(_averages(squares, blocks)) / (2 * size) if size > 0 else 0.0)


def half_width(averages: Array) -> float:
    """Half the width of the 95 % interval of the mean of independent averages, by Student's t; NaN for fewer than two.

    Args:
        averages: shape (B,).
    """
    from scipy.special import stdtrit

    count = len(averages)
    if count < 2:
        return float("nan")
    return float(stdtrit(count - 1, 0.975) * averages.std(ddof=1) / np.sqrt(count))


def _averages(values: Array, blocks: int) -> Array:
    """Averages over as many blocks of the same length, at least two values each; the first values are left over."""
    count = min(blocks, len(values) // 2)
    length = len(values) // count if count else 0
    return values[len(values) - count * length :].reshape(count, -1).mean(axis=1) if count else np.zeros(0)
