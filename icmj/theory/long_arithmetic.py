"""Matrices with twice the digits of a float, as sums of two: what a flow grows by is not lost to rounding.

A product is exact where factors have few digits: each factor is cut into parts of 23 bits, so that the products of
parts are sums of integers below 2⁵³, and only their sum is rounded (Ozaki, Ogita, Oishi, Rump 2012). What is left is
some 1e-27 of a row times a column.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.theory.flow import Flow

_BITS, _PARTS = 23, 4  # of each part of a factor, so that sums of 64 products are exact, and how many parts it has
_SPLIT = 2.0**27 + 1  # cuts a float in two of 26 bits
_TERMS = 27  # 1/28! = 3e-30


@dataclass(frozen=True, eq=False)
class LongArray:
    """``high + low``, of which ``high`` is the nearest float."""

    high: Array
    low: Array

    __array_ufunc__ = None  # arrays leave it to this class what a sum or a product with it is

    def __add__(self, other: Array | LongArray) -> LongArray:
        other = _lengthen(other)
        high, error = _add(self.high, other.high)
        return _join(high, error + self.low + other.low)

    __radd__ = __add__

    def __matmul__(self, other: Array | LongArray) -> LongArray:
        a, b = _cut(self, -1), _cut(_lengthen(other), -2)
        high = a[0] @ b[0]
        low = np.zeros_like(high)
        for order in range(1, _PARTS):
            for i in range(order + 1):
                high, error = _add(high, a[i] @ b[order - i])
                low = low + error
        return _join(high, low)

    def __rmatmul__(self, other: Array) -> LongArray:
        return _lengthen(other) @ self

    def __getitem__(self, at: Any) -> LongArray:
        return LongArray(self.high[at], self.low[at])

    def times(self, factor: Array) -> LongArray:
        """Each entry times a float."""
        high = self.high * factor
        a, b = (_SPLIT * x - (_SPLIT * x - x) for x in (self.high, factor))
        c, d = self.high - a, factor - b
        return _join(high, ((a * b - high) + a * d + c * b) + c * d + self.low * factor)


@dataclass(frozen=True, eq=False)
class LongFlow:
    """The flow of Ā_C as in :class:`icmj.theory.flow.Flow`, with long increments."""

    of: Flow
    series: tuple[LongArray, ...]

    @property
    def A_C(self) -> Array:
        return self.of.A_C

    def increment(self, t: ArrayLike) -> LongArray:
        """F(t) = e^{Ā_C t} − I for each t ≥ 0, shape (..., N, N)."""
        t = np.asarray(t, dtype=float)
        doublings = self.of.count_doublings(t.max(initial=0.0))
        short = (t / 2.0**doublings / self.of.unit)[..., None, None]
        F = self.series[-1].times(short)
        for term in self.series[-2::-1]:
            F = (term + F).times(short)
        for _ in range(doublings):
            F = F + F + F @ F
        scale = self.of.scale[:, None] / self.of.scale
        return LongArray(F.high * scale, F.low * scale)


def lengthen_flow(flow: Flow) -> LongFlow:
    """The same flow in long arithmetic."""
    step = _lengthen(flow.balanced * flow.unit)
    series = [step]
    for k in range(2, _TERMS + 1):
        product = series[-1] @ step
        high = product.high / k
        left = (product + LongArray(high, np.zeros_like(high)).times(np.full_like(high, -k))).high
        series.append(_join(high, left / k))
    return LongFlow(flow, tuple(series))


def settle(F: Array | LongArray, *others: Array | LongArray) -> list[Array]:
    """Matrices of floats similar to F and the others alike, whose eigenvalues are as good as long ones allow.

    In the basis of approximate eigenvectors of F its eigenvalues are known to the rounding of the largest one, however
    ill-conditioned they are. What is no long array is returned as it is.
    """
    if not isinstance(F, LongArray):
        return [F, *(other for other in others if not isinstance(other, LongArray))]
    g, V = np.linalg.eig(F.high)
    W = np.where(g.imag[..., None, :] < 0, V.imag, V.real)  # a pair is next to each other
    try:
        X = np.linalg.inv(W)
        one = (X @ _lengthen(W)).high
        return [np.asarray(np.linalg.solve(one, ((X @ _lengthen(M)) @ W).high)) for M in (F, *others)]
    except np.linalg.LinAlgError:  # there is no such basis
        return [_lengthen(M).high for M in (F, *others)]


def _lengthen(M: Array | LongArray) -> LongArray:
    return M if isinstance(M, LongArray) else LongArray(M, np.zeros_like(M))


def _add(a: Array, b: Array) -> tuple[Array, Array]:
    """The sum and its rounding error, exactly."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def _join(high: Array, low: Array) -> LongArray:
    total = high + low
    return LongArray(total, low - (total - high))


def _cut(M: LongArray, axis: int) -> list[Array]:
    """Parts of so few bits that sums along ``axis`` of their products are exact, the largest first."""
    parts, high, low = [], M.high, M.low
    largest = np.abs(high).max(axis=axis, keepdims=True)
    top = np.exp2(np.ceil(np.log2(np.where(largest > 0, largest, 1.0))))
    for k in range(1, _PARTS + 1):
        unit = 1.5 * top * 2.0 ** (53 - _BITS * k)
        part = (high + unit) - unit
        high, low = _add(high - part, low)
        parts.append(part)
    return parts
