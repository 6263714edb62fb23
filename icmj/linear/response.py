"""What acts on a linear loop from outside, worked out ahead: its polynomials on steps, and the response to them.

Steps lie on a grid of their own, the same for every motion, so all that does not depend on the state is a product of
matrices for hundreds of steps at once. Sinusoids are many and slow beside a step: they are evaluated at a few instants
of a *stride* of several steps, and interpolated from there to all of these, to rounding.
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly, chebvander

from icmj.base.array import Array
from icmj.linear.loop import Forcing
from icmj.linear.native.state import Acting, Tables
from icmj.linear.tables import ROUNDING

_STRIDE = 16  # steps
_AHEAD = 32  # strides that are worked out at once


class Response:
    """The response to ``forcing`` on the grid of ``tables``; keeps what it has worked out last.

    Attributes:
        acting: that.
    """

    acting: Acting

    def __init__(self, tables: Tables, forcing: Forcing) -> None:
        """Prepare the matrices."""
        self._tables, self._forcing = T, F = tables, forcing
        self._rooms: dict[str, Array] = {}
        m = len(T.M)
        self._signals = signals = T.M.shape[1] - m
        self.acting = Acting(
            0, -1.0, np.zeros((0, T.powers * signals)), np.zeros((0, m)), np.zeros((0, T.controls)),
            np.zeros((0, len(T.V))), np.zeros((0, 0, m)),
        )  # fmt: skip
        if not signals:
            return
        stride, fastest = _STRIDE * T.step, float(F.omega.max(initial=0.0))
        nodes = _nodes(fastest * stride / 2)
        self._to_steps = _interpolation(len(nodes), T.powers)
        # a cos(ω(t + u) + φ) = Re w a cos ωu − Im w a sin ωu with w = exp i(ωt + φ), about the middle t of a stride
        angle = np.outer(nodes * stride / 2, F.omega)
        share = np.stack([np.cos(angle), -np.sin(angle)], axis=-1) * F.amplitude[:, None]
        ranges = np.searchsorted(F.signal, np.arange(signals + 1))
        self._ranges = [slice(2 * first, 2 * last) for first, last in zip(ranges[:-1], ranges[1:], strict=True)]
        self._shares = [share.reshape(len(nodes), -1)[:, part].copy() for part in self._ranges]
        self._turns = np.exp(1j * np.outer(np.arange(_AHEAD) * stride, F.omega))

    def _room(self, name: str, *shape: int) -> Array:
        """An array of that shape to write into; new memory would cost as much as what is written."""
        size = int(np.prod(shape))
        if name not in self._rooms or self._rooms[name].size < size:
            self._rooms[name] = np.empty(size)
        return self._rooms[name][:size].reshape(shape)

    def reach(self, cell: int, edge: float) -> Acting:
        """:class:`icmj.linear.native.state.Acting` for the ``cell``-th step, until terms begin or end at ``edge`` [s]."""
        acting, T, F = self.acting, self._tables, self._forcing
        if acting.edge == edge and 0 <= cell - acting.first < len(acting.f):
            return acting
        h, m = T.step, len(T.M)
        since = T.edges[max(int(np.searchsorted(T.edges, edge)) - 1, 0)]
        since = since if since < edge else 0.0
        # all that lies within the stretch between the edges, of the strides that are worked out together
        together = cell // (_STRIDE * _AHEAD) * _AHEAD
        first = max(together, int(since / h * (1 - 1e-12)) // _STRIDE)
        last = min(together + _AHEAD, int(min(edge / h, 1e15) * (1 + 1e-12)) // _STRIDE + 1)
        middle = (first + 0.5) * _STRIDE * h
        acts = (F.start <= since) & (since < F.end)
        begin = np.where(acts, np.exp(1j * (F.omega * middle + F.phase)), 0.0)
        waves = (self._turns[: last - first] * begin).view(float)
        count, room = last - first, self._room
        values = room("values", self._to_steps.shape[1], count, self._signals)
        for signal, (part, share) in enumerate(zip(self._ranges, self._shares, strict=True)):
            values[:, :, signal] = share @ waves[:, part].T
        steps = room("steps", len(self._to_steps), count * self._signals)
        np.matmul(self._to_steps, values.reshape(len(values), -1), out=steps)
        f = room("f", count * _STRIDE, T.powers * self._signals)
        by_step = f.reshape(count, _STRIDE, T.powers, self._signals)
        by_step[:] = steps.reshape(_STRIDE, T.powers, count, self._signals).transpose(2, 0, 1, 3)
        moved = np.matmul(f, T.W[:m, m:].T, out=room("moved", len(f), m))
        known = min((T.coarse + 1) * self._signals, f.shape[1])
        controls = room("controls", len(f), T.controls)
        np.matmul(f[:, :known], T.W[m : m + T.controls, m : m + known].T, out=controls)
        tails = np.matmul(np.abs(f, out=room("sizes", *f.shape)), T.V[:, m:].T)
        rows = room("rows", max(T.places - 1, 0), len(f), m)
        for place in range(1, T.places):
            np.matmul(f, T.R[place].T, out=rows[place - 1])
        self.acting = Acting(first * _STRIDE, edge, f, moved, controls, tails, rows)
        return self.acting


def _nodes(turn: float) -> Array:
    """Chebyshev's, of as many as interpolate a sinusoid that turns by this on either side of the middle [rad]."""
    count = next(n for n in range(1, 1000) if 2 * (turn / 2) ** n / factorial(n) <= ROUNDING)
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _coefficients(nodes: Array) -> Array:
    """From values at Chebyshev's nodes to coefficients of his polynomials."""
    to = 2 / len(nodes) * chebvander(nodes, len(nodes) - 1).T
    to[0] /= 2
    return to


@lru_cache(maxsize=64)
def _interpolation(count: int, powers: int) -> Array:
    """From values at ``count`` nodes of a stride to Taylor coefficients about the middle of each of its steps.

    Returns:
        shape (steps · powers, count).
    """
    coarse, fine = (np.cos(np.pi * (np.arange(n) + 0.5) / n) for n in (count, powers))
    to_powers = np.zeros((powers, powers))
    for k in range(powers):
        to_powers[: k + 1, k] = cheb2poly(np.eye(powers)[k])[: k + 1]
    to_powers = (2.0 ** np.arange(powers))[:, None] * to_powers @ _coefficients(fine)
    places = (np.arange(_STRIDE)[:, None] + (fine + 1) / 2) / _STRIDE * 2 - 1
    values = chebvander(places, count - 1) @ _coefficients(coarse)
    return np.asarray((to_powers @ values).reshape(_STRIDE * powers, count))
