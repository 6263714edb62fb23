"""Exogenous inputs of a linear loop computed in advance: their polynomials on steps, and the response to them.

Steps lie on a grid of their own, the same for every motion, so all that does not depend on the state is a product of
matrices for hundreds of steps at once. Sinusoids are many, and slow beside a step: they are evaluated at a few instants
of a stride of several steps (:mod:`icmj.simulation.waves`), and interpolated from there to all of these, to rounding.
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial, prod

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly, chebvander

from icmj.base.array import Array
from icmj.linear.loop import Forcing
from icmj.linear.native.state import Acting, Tables
from icmj.simulation.gaussian import at_points
from icmj.simulation.waves import Waves, coefficients, nodes

_STRIDE = 16  # steps
_AHEAD = 32  # strides that are worked out at once
_POINTS = 1 << 14  # of Gaussian noise that are drawn at once, of a long run


class Response:
    """The response to ``forcing`` on the grid of ``tables``; caches the last steps computed.

    Attributes:
        acting: that.
    """

    acting: Acting

    def __init__(self, tables: Tables, forcing: Forcing) -> None:
        """Prepare the matrices."""
        self._tables, self._forcing = T, F = tables, forcing
        self._rooms: dict[str, Array] = {}
        self._points = [np.zeros(0) for _ in forcing.gaussian]
        m = len(T.M)
        self._signals = signals = T.M.shape[1] - m
        self.acting = Acting(
            0, -1.0, np.zeros((0, T.powers * signals)), np.zeros((0, m)), np.zeros((0, T.controls)),
            np.zeros((0, len(T.V))), np.zeros((0, 0, m)),
        )  # fmt: skip
        if not signals:
            return
        self._waves = Waves(F.signal, F.amplitude, F.omega, F.phase, signals, _STRIDE * T.step)
        self._to_steps = _interpolation(self._waves.count, T.powers)

    def _add_gaussian(self, f: Array, cell: int, since: float) -> None:
        """Add the lines of Gaussian noise on the steps from ``cell`` on to their polynomials ``f``, (K, powers, S)."""
        for number, (signal, noise) in enumerate(self._forcing.gaussian):
            if noise.start > since:
                continue
            steps = round(noise.interval / self._tables.step)
            first, last = cell // steps, (cell + len(f)) // steps + 2
            if last > len(self._points[number]):
                longest = int(min(self._tables.end / noise.interval, 1e15)) + 2
                self._points[number] = at_points(noise, 0, max(last, min(longest, max(_POINTS, 2 * last))))
            edges = self._points[number][first:last]
            if steps > 1:
                edges = np.interp(np.arange(cell, cell + len(f) + 1), steps * np.arange(first, last), edges)
            edges = edges[: len(f) + 1]
            f[:, 0, signal] += (edges[1:] + edges[:-1]) / 2
            f[:, 1, signal] += edges[1:] - edges[:-1]

    def _room(self, name: str, *shape: int) -> Array:
        """An array of that shape to write into; new memory would cost as much as what is written."""
        size = prod(shape)
        if name not in self._rooms or self._rooms[name].size < size:
            self._rooms[name] = np.empty(size)
        return self._rooms[name][:size].reshape(shape)

    def reach(self, cell: int, edge: float) -> Acting:
        """The input on the ``cell``-th step and on many after it, until terms begin or end at ``edge`` [s]."""
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
        count, room = last - first, self._room
        f = room("f", count * _STRIDE, T.powers * self._signals)
        by_step = f.reshape(count, _STRIDE, T.powers, self._signals)
        if len(F.omega):
            values = room("values", self._waves.count, count, self._signals)
            self._waves.at_nodes(first, count, (F.start <= since) & (since < F.end), out=values)
            steps = room("steps", len(self._to_steps), count * self._signals)
            np.matmul(self._to_steps, values.reshape(len(values), -1), out=steps)
            by_step[:] = steps.reshape(_STRIDE, T.powers, count, self._signals).transpose(2, 0, 1, 3)
        else:
            by_step[:] = 0.0
        self._add_gaussian(by_step.reshape(len(f), T.powers, -1), first * _STRIDE, since)
        moved = np.matmul(f, T.W[:m, m:].T, out=room("moved", len(f), m))
        known = min((T.coarse + 1) * self._signals, f.shape[1])
        controls = room("controls", len(f), T.controls)
        np.matmul(f[:, :known], T.W[-T.controls :, m : m + known].T, out=controls)
        tails = np.matmul(np.abs(f, out=room("sizes", *f.shape)), T.V[:, m:].T)
        rows = room("rows", max(T.places - 1, 0), len(f), m)
        for place in range(1, T.places):
            np.matmul(f, T.R[place].T, out=rows[place - 1])
        self.acting = Acting(first * _STRIDE, edge, f, moved, controls, tails, rows)
        return self.acting


@lru_cache(maxsize=64)
def _interpolation(count: int, powers: int) -> Array:
    """From values at ``count`` nodes of a stride to derivatives at the middle of each of its steps.

    Returns:
        shape (steps · powers, count).
    """
    to_powers = np.zeros((powers, powers))
    for k in range(powers):
        to_powers[: k + 1, k] = cheb2poly(np.eye(powers)[k])[: k + 1]
    scale = np.array([2.0**j * factorial(j) for j in range(powers)])
    to_derivatives = scale[:, None] * to_powers @ coefficients(powers)
    places = (np.arange(_STRIDE)[:, None] + (nodes(powers) + 1) / 2) / _STRIDE * 2 - 1
    values = chebvander(places, count - 1) @ coefficients(count)
    return np.asarray((to_derivatives @ values).reshape(_STRIDE * powers, count))
