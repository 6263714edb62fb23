"""Sums of many sinusoids at many instants: evaluated at a few of each *stride* of time, interpolated from there.

On a stride short beside none of them, sinusoids are polynomials of some forty Chebyshev nodes, to less than the
rounding of their angles. At the nodes of all strides their sum is a product of matrices, cos(ω(t + u) + φ) being
cos ωu cos(ωt + φ) − sin ωu sin(ωt + φ) about the middle t of a stride. The first is even in u and the second odd, and
nodes lie in pairs ±u: each is worked out at half of the nodes.
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


def make_nodes(count: int) -> np.ndarray:
    """Chebyshev nodes on [−1, 1]."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


@lru_cache(maxsize=64)
def make_coefficient_matrix(count: int) -> Array:
    """Matrix from values at Chebyshev nodes to Chebyshev coefficients, shape (count, count)."""
    to = 2 / count * chebvander(make_nodes(count), count - 1).T
    to[0] /= 2
    return to


def count_nodes(turn: float) -> int:
    """Number of nodes that interpolate a sinusoid whose phase changes by this on either side of the middle [rad]."""
    return next(n for n in range(1, 1000) if 2 * (turn / 2) ** n / factorial(n) <= ROUNDING)


def split_matrix(matrix: Array) -> Array:
    """The same of the even and the odd part of values at half of their nodes, as ``matrix`` makes of the values."""
    count = matrix.shape[1]
    half = (count + 1) // 2
    first, last = matrix[:, :half], matrix[:, ::-1][:, :half]
    even = first + last
    if count % 2:  # the node in the middle is its own partner
        even[:, -1] /= 2
    return np.hstack([even, first - last])


class Waves:
    """K sinusoids a cos(ωt + φ) in S signals, on strides that are counted from zero.

    Attributes:
        stride: its length [s].
        count: of nodes.
        half: of these that are not negative.
    """

    stride: float
    count: int
    half: int

    def __init__(
        self, signal: np.ndarray, amplitude: Array, omega: Array, phase: Array, signals: int, stride: float = 0
    ):
        """``signal`` says which signal each belongs to, rising; a ``stride`` of zero is chosen."""
        fastest = float(omega.max(initial=0.0))
        self.stride = stride or (2 * _TURN / fastest if fastest > 0 else 1.0)
        self.count = count_nodes(fastest * self.stride / 2)
        self.half = (self.count + 1) // 2
        self._omega, self._phase, self._signals = omega, phase, signals
        angle = np.outer(make_nodes(self.count)[: self.half] * self.stride / 2, omega)
        share = np.cos(angle) * amplitude, -np.sin(angle) * amplitude
        parts = pairwise(np.searchsorted(signal, np.arange(signals + 1)))
        self._parts = [slice(*part) for part in parts]
        self._shares = [tuple(of[:, part].copy() for of in share) for part in self._parts]
        longest = {part.stop - part.start for part in self._parts}
        # of as many sinusoids in each, all signals are one product
        self._alike = np.array(self._shares).swapaxes(0, 1) if len(longest) == 1 < signals else None
        self._turns = self._room = np.ones((2, len(omega), 0))

    def at_nodes(self, first: int, number: int, acting: np.ndarray | None = None, out: Array | None = None) -> Array:
        """Even and odd part of the signals over so many strides, at half of the nodes; of those that are ``acting``.

        Returns:
            shape (2, half, S, number).
        """
        from icmj.simulation.native.waves import turn

        if self._turns.shape[2] < number:
            angle = np.outer(self._omega, np.arange(number) * self.stride)
            self._turns, self._room = np.stack([np.cos(angle), np.sin(angle)]), np.empty((2, *angle.shape))
        begin = self._omega * ((first + 0.5) * self.stride) + self._phase
        real, imaginary = np.cos(begin), np.sin(begin)
        if acting is not None and not acting.all():
            real, imaginary = real * acting, imaginary * acting
        turned = self._room.reshape(-1)[: 2 * len(begin) * number].reshape(2, -1, number)
        turn(self._turns, real, imaginary, turned)
        cos, sin = turned
        values = np.empty((2, self.half, self._signals, number)) if out is None else out
        if self._alike is not None:
            for of, share, sinusoids in zip(values, self._alike, turned, strict=True):
                np.matmul(share, sinusoids.reshape(self._signals, -1, number), out=of.swapaxes(0, 1))
            return values
        for signal, (part, (even, odd)) in enumerate(zip(self._parts, self._shares, strict=True)):
            np.matmul(even, cos[part], out=values[0, :, signal])
            np.matmul(odd, sin[part], out=values[1, :, signal])
        return values

    def __call__(self, t: Array) -> Array:
        """The signals at rising instants ``t`` [s], shape (N, S)."""
        found = np.empty((len(t), self._signals))
        for begin in range(0, len(t), _AT_ONCE):
            part = t[begin : begin + _AT_ONCE]
            stride = np.floor(part / self.stride).astype(int)
            first, number = int(stride[0]), int(stride[-1] - stride[0]) + 1
            values = self.at_nodes(first, number).reshape(2 * self.half, self._signals, number)
            series = np.tensordot(split_matrix(make_coefficient_matrix(self.count)), values, 1).transpose(2, 0, 1)
            values = chebvander(2 * (part / self.stride - stride) - 1, self.count - 1)
            found[begin : begin + _AT_ONCE] = np.matmul(values[:, None, :], series[stride - first])[:, 0]
        return found
