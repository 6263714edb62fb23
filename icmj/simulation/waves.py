"""Sums of many sinusoids at many instants: evaluated at a few of each *stride* of time, interpolated from there.

On a stride short beside none of them, sinusoids are polynomials of some forty Chebyshev nodes, to less than the
rounding of their angles. At the nodes of all strides their sum is a product of matrices, cos(ω(t + u) + φ) being
cos ωu cos(ωt + φ) − sin ωu sin(ωt + φ) about the middle t of a stride.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from math import factorial

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from icmj.base.array import Array

ROUNDING = 1e-15  # of a sinusoid of one: less than the rounding of its angle
_TURN = 8.0  # of the fastest sinusoid on either side of a stride's middle [rad]
_AT_ONCE = 8192  # instants


def nodes(count: int) -> np.ndarray:
    """Chebyshev nodes on [−1, 1]."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


@lru_cache(maxsize=64)
def coefficients(count: int) -> Array:
    """Matrix from values at Chebyshev nodes to Chebyshev coefficients, shape (count, count)."""
    to = 2 / count * chebvander(nodes(count), count - 1).T
    to[0] /= 2
    return to


def enough(turn: float) -> int:
    """Number of nodes that interpolate a sinusoid whose phase changes by this on either side of the middle [rad]."""
    return next(n for n in range(1, 1000) if 2 * (turn / 2) ** n / factorial(n) <= ROUNDING)


class Waves:
    """K sinusoids a cos(ωt + φ) in S signals, on strides that are counted from zero.

    Attributes:
        stride: its length [s].
        count: of nodes.
    """

    stride: float
    count: int

    def __init__(
        self, signal: np.ndarray, amplitude: Array, omega: Array, phase: Array, signals: int, stride: float = 0
    ):
        """``signal`` says which signal each belongs to, rising; a ``stride`` of zero is chosen."""
        fastest = float(omega.max(initial=0.0))
        self.stride = stride or (2 * _TURN / fastest if fastest > 0 else 1.0)
        self.count = enough(fastest * self.stride / 2)
        self._omega, self._phase, self._signals = omega, phase, signals
        angle = np.outer(nodes(self.count) * self.stride / 2, omega)
        share = np.stack([np.cos(angle), -np.sin(angle)], axis=-1) * amplitude[:, None]
        ranges = 2 * np.searchsorted(signal, np.arange(signals + 1))
        self._ranges = [slice(*pair) for pair in pairwise(ranges)]
        self._shares = [share.reshape(self.count, -1)[:, part].copy() for part in self._ranges]
        self._turns = np.ones((0, len(omega)), complex)

    def at_nodes(self, first: int, number: int, acting: np.ndarray | None = None, out: Array | None = None) -> Array:
        """The signals at the nodes of so many strides, shape (count, number, S); of those that are ``acting``."""
        if len(self._turns) < number:
            self._turns = np.exp(1j * np.outer(np.arange(number) * self.stride, self._omega))
        begin = np.exp(1j * (self._omega * ((first + 0.5) * self.stride) + self._phase))
        if acting is not None:
            begin *= acting
        waves = (self._turns[:number] * begin).view(float)
        values = np.empty((self.count, number, self._signals)) if out is None else out
        for signal, (part, share) in enumerate(zip(self._ranges, self._shares, strict=True)):
            values[:, :, signal] = share @ waves[:, part].T
        return values

    def __call__(self, t: Array) -> Array:
        """The signals at rising instants ``t`` [s], shape (N, S)."""
        found = np.empty((len(t), self._signals))
        for begin in range(0, len(t), _AT_ONCE):
            part = t[begin : begin + _AT_ONCE]
            stride = np.floor(part / self.stride).astype(int)
            first, number = int(stride[0]), int(stride[-1] - stride[0]) + 1
            series = np.tensordot(coefficients(self.count), self.at_nodes(first, number), 1).transpose(1, 0, 2)
            values = chebvander(2 * (part / self.stride - stride) - 1, self.count - 1)
            found[begin : begin + _AT_ONCE] = np.matmul(values[:, None, :], series[stride - first])[:, 0]
        return found
