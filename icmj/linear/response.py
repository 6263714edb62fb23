"""Exogenous inputs of a linear loop computed in advance: their polynomials on steps, and the response to them.

Steps lie on a grid of their own, the same for every motion, so all that does not depend on the state is a product of
matrices for hundreds of steps at once. Sinusoids are many, and slow beside a step: they are evaluated at a few instants
of a stride of several steps (:mod:`icmj.simulation.sinusoids`), and interpolated from there to all of these, to
rounding.
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial, prod

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly, chebvander

from icmj.base.array import Array
from icmj.linear.loop import Forcing
from icmj.linear.native.motion import Acting, Tables
from icmj.simulation.grid import draw_at_points
from icmj.simulation.sinusoids import Waves, make_coefficient_matrix, make_nodes, split_matrix

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
        self._largest = np.zeros((len(forcing.gaussian), 2))
        m, self._edge = len(T.M), -1.0
        self._signals = signals = T.M.shape[1] - m
        self.acting = Acting(
            0, -1.0, np.zeros((1, T.powers * signals, 0)), np.zeros((1, 0, m)), np.zeros((1, 0, 0)),
            np.zeros((1, 0, T.controls)), np.zeros(len(T.V)),
        )  # fmt: skip
        if not signals:
            return
        self._waves = Waves(F.input, F.amplitude, F.omega, F.phase, signals, _STRIDE * T.step)
        self._to_steps = _interpolation(self._waves.count, T.powers)
        # rows apart: the product of other shapes is rounded otherwise, and rows may change no bit of the motion
        self._to_z = T.W[:m, m:].T.copy()
        self._to_rows = np.vstack([np.zeros((0, T.powers * signals)), *T.R[1:]]).T.copy()
        self._known = min((T.coarse + 1) * signals, T.powers * signals)
        self._to_controls = T.W[-T.controls :, m : m + self._known].T.copy()
        self._to_tails = np.ascontiguousarray(T.V[:, m:])

    def _add_gaussian(self, f: Array, cell: int, since: float) -> Array:
        """Add the lines of Gaussian noise on the steps from ``cell`` on to ``f``, shape (lanes, powers, S, K / lanes).

        Returns:
            how large they can be a step beyond either end of theirs, shape (powers, S).
        """
        size, count = np.zeros(f.shape[1:3]), f.shape[3]
        for number, (signal, noise) in enumerate(self._forcing.gaussian):
            if noise.start > since:
                continue
            steps = round(noise.interval / self._tables.step)
            first, last = cell // steps, (cell + count * _STRIDE) // steps + 2
            if last > len(self._points[number]):
                longest = int(min(self._tables.end / noise.interval, 1e15)) + 2
                points = draw_at_points(noise, 0, max(last, min(longest, max(_POINTS, 2 * last))))
                self._points[number], steepest = points, np.abs(np.diff(points)).max() / steps
                self._largest[number] = np.abs(points).max() + steepest, steepest
            edges = self._points[number][first:last]
            if steps > 1:
                at = np.arange(cell, cell + count * _STRIDE + 1)
                edges = np.interp(at, steps * np.arange(first, last), edges)
            edges = edges[: count * _STRIDE + 1]
            f[:, 0, signal] += ((edges[1:] + edges[:-1]) / 2).reshape(count, _STRIDE).T
            f[:, 1, signal] += (edges[1:] - edges[:-1]).reshape(count, _STRIDE).T
            size[:2, signal] += self._largest[number]
        return size

    def _sizes(self, edge: float, acting: np.ndarray) -> Array:
        """How large derivatives of the sinusoids can be that act until ``edge``, in steps, shape (powers, S)."""
        if edge != self._edge:
            F, T = self._forcing, self._tables
            terms = np.abs(F.amplitude) * acting * (F.omega * T.step) ** np.arange(T.powers)[:, None]
            self._size, self._edge = terms @ (F.input[:, None] == np.arange(self._signals)), edge
        return self._size

    def _room(self, name: str, *shape: int) -> Array:
        """An array of that shape to write into; new memory would cost as much as what is written."""
        size = prod(shape)
        if name not in self._rooms or self._rooms[name].size < size:
            self._rooms[name] = np.empty(size)
        return self._rooms[name][:size].reshape(shape)

    def reach(self, cell: int, edge: float) -> Acting:
        """The input on the ``cell``-th step and on many after it, until terms begin or end at ``edge`` [s]."""
        acting, T, F = self.acting, self._tables, self._forcing
        if acting.edge == edge and 0 <= cell - acting.first < len(acting.f) * acting.f.shape[2]:
            return acting
        h = T.step
        since = T.edges[max(int(np.searchsorted(T.edges, edge)) - 1, 0)]
        since = since if since < edge else 0.0
        # all that lies within the stretch between the edges, of the strides that are worked out together
        together = cell // (_STRIDE * _AHEAD) * _AHEAD
        first = max(together, int(since / h * (1 - 1e-12)) // _STRIDE)
        last = min(together + _AHEAD, int(min(edge / h, 1e15) * (1 + 1e-12)) // _STRIDE + 1)
        count, room = last - first, self._room
        f = room("f", _STRIDE, T.powers, self._signals, count)
        if len(F.omega):
            acts = (F.start <= since) & (since < F.end)
            values = room("values", 2, self._waves.half, self._signals, count)
            self._waves.at_nodes(first, count, acts, out=values)
            size = self._sizes(edge, acts)
            np.matmul(self._to_steps, values.reshape(2 * self._waves.half, -1), out=f.reshape(len(self._to_steps), -1))
        else:
            f[:], size = 0.0, np.zeros((T.powers, self._signals))
        if F.gaussian:
            size = size + self._add_gaussian(f, first * _STRIDE, since)
        f = f.reshape(_STRIDE, -1, count)
        by_step = f.transpose(0, 2, 1)
        moved = np.matmul(by_step, self._to_z, out=room("moved", _STRIDE, count, self._to_z.shape[1]))
        rows = np.matmul(by_step, self._to_rows, out=room("rows", _STRIDE, count, self._to_rows.shape[1]))
        controls = room("controls", _STRIDE, count, T.controls)
        np.matmul(by_step[:, :, : self._known], self._to_controls, out=controls)
        self.acting = Acting(first * _STRIDE, edge, f, moved, rows, controls, self._to_tails @ size.ravel())
        return self.acting


@lru_cache(maxsize=64)
def _interpolation(count: int, powers: int) -> Array:
    """From even and odd part at half of ``count`` nodes of a stride to derivatives at the middle of each of its steps.

    Returns:
        shape (steps · powers, …).
    """
    to_powers = np.zeros((powers, powers))
    for k in range(powers):
        to_powers[: k + 1, k] = cheb2poly(np.eye(powers)[k])[: k + 1]
    scale = np.array([2.0**j * factorial(j) for j in range(powers)])
    to_derivatives = scale[:, None] * to_powers @ make_coefficient_matrix(powers)
    places = (np.arange(_STRIDE)[:, None] + (make_nodes(powers) + 1) / 2) / _STRIDE * 2 - 1
    values = chebvander(places, count - 1) @ make_coefficient_matrix(count)
    return split_matrix((to_derivatives @ values).reshape(_STRIDE * powers, count))
