"""Watching the motion: where the event function, a limit or divergence ends it, and how far the outputs go."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import beginning, first_root, largest
from icmj.linear.closed_loop import LinearLoop
from icmj.linear.propagator import Propagator

DIVERGED = 1e12
_LANDING = 1e-12  # an event this close after the end of a piece [s] is at its end


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of the motion, at most one block of steps long.

    Attributes:
        kind: why it ended; ``end`` is the end of the block or of the time asked for.
        length: [s].
        complete: whether it covers all the time asked for.
        Z: state at the start of each step, shape (steps, m).
        z: state at the end, shape (m,).
        y_max, y_min: extremes of the outputs over the piece, shape (n_y,).
    """

    kind: Literal["end", "event", "fell", "diverged"]
    length: float
    complete: bool
    Z: Array
    z: Array
    y_max: Array
    y_min: Array

    def ended(self, z: Array) -> Piece:
        """The same piece with another state at its end, where an action set the hold."""
        return replace(self, z=z)

    def as_event(self) -> Piece:
        """The same piece, ended by an event that falls due at its end."""
        return replace(self, kind="event")


class Watch:
    """Advances the motion and looks for its end on every step by certified bounds.

    A curve R_j e(θ) stays within the largest norm of its control points, so a step whose control points are all
    inside every face of the event rule holds no event; only the others are looked at more closely.

    Attributes:
        propagator: of the motion.
        faces: of the event rule.
        rows: what is watched, one row each: components of the hold error in the faces, positions over their limit,
            outputs; shape (r, m).
    """

    def __init__(self, loop: LinearLoop, propagator: Propagator, limit: float) -> None:
        self.propagator, self.faces = propagator, loop.faces
        positions, n_y, size = loop.positions, loop.plant.n_y, propagator.size
        r = len(self.faces.R)
        rows = np.zeros((r + len(positions) + n_y, size))
        rows[:r, loop.layout["e"]] = self.faces.R
        rows[r + np.arange(len(positions)), positions] = 1 / limit
        rows[r + len(positions) :, loop.layout["x"]] = loop.plant.C
        self._error, self._position, self._output = np.split(np.arange(len(rows)), [r, r + len(positions)])
        self.rows = rows
        self._shape = (propagator.degree + 1, len(rows))

    @cached_property
    def _powers(self) -> Array:
        return self.propagator.powers_of(self.rows)

    @cached_property
    def _controls(self) -> Array:
        return self.propagator.controls_of(self.rows).reshape(-1, self.propagator.size)

    def advance(self, z: Array, length: float, armed: bool) -> Piece:
        """The motion from ``z`` for ``length`` seconds or one block, whichever is shorter, or until something ends it.

        Args:
            z: state at the start, shape (m,).
            length: time asked for [s].
            armed: whether the event function is watched.
        """
        h = self.propagator.h
        steps = int(min(np.ceil(length / h * (1 - 1e-14)), self.propagator.block)) or 1
        complete = steps * h >= length * (1 - 1e-14)
        last = min((length - (steps - 1) * h) / h, 1.0) if complete else 1.0
        Z = self.propagator.states(z, steps)
        controls = (Z[:-1] @ self._controls.T).reshape(steps, *self._shape)
        kind, step, theta = self._first_end(Z, controls, last, armed)
        Z = Z[: step + 1]
        end = self.propagator.within(Z[-1:], np.array([theta]))[0]
        span = length if complete and kind == "end" else min((step + theta) * h, length)
        y_max, y_min = self._extremes(Z, end, controls[: step + 1], theta)
        return Piece(kind, span, complete, Z, end, y_max, y_min)

    def _first_end(
        self, Z: Array, controls: Array, last: float, armed: bool
    ) -> tuple[Literal["end", "event", "fell", "diverged"], int, float]:
        steps = len(controls)
        grown = np.nonzero(~(np.abs(Z[1:]).max(axis=1) <= DIVERGED))[0]
        until = grown[0] + 1 if len(grown) else steps
        suspect = np.abs(controls[:until, :, self._position]).max(axis=(1, 2), initial=0) >= 1
        if armed:
            norms = self.faces.squares(controls[:until, :, self._error]).max(axis=(1, 2))
            suspect |= norms >= 1 - 1e-12
        for step in np.nonzero(suspect)[0]:
            longest = min(last + _LANDING / self.propagator.h, 1.0) if step == steps - 1 else 1.0
            kind, theta = self._root(Z[step], armed)
            if theta <= longest:
                return kind, int(step), min(theta, last) if step == steps - 1 else theta
        if len(grown):
            return "diverged", int(until - 1), last if until == steps else 1.0
        return "end", steps - 1, last

    def _root(self, z: Array, armed: bool) -> tuple[Literal["event", "fell"], float]:
        """First time on the step from ``z`` at which it falls or has an event; infinity if it does neither."""
        powers = self._powers @ z
        kind: Literal["event", "fell"] = "fell"
        first = np.inf
        for column in self._position:
            for sign in (1, -1):
                distance = sign * powers[:, column]
                distance[0] -= 1
                theta = first_root(distance)
                first = min(first, np.inf if theta is None else theta)
        if armed:
            for level in self.faces.polynomials(powers[:, self._error]).T:
                theta = first_root(level)
                if theta is not None and theta < first:
                    kind, first = "event", theta
        return kind, first

    def _extremes(self, Z: Array, end: Array, controls: Array, theta: float) -> tuple[Array, Array]:
        rows, controls = self.rows[self._output], controls[:, :, self._output]
        if theta < 1:
            last = beginning(controls.shape[1] - 1, theta) @ controls[-1]
            controls = np.concatenate([controls[:-1], last[None]])
        ends = np.vstack([Z @ rows.T, rows @ end])
        extremes = []
        for sign in (1, -1):
            values = sign * ends
            reached = values.max(axis=0)
            bounds = (sign * controls).max(axis=1)
            for step, output in np.argwhere(bounds > reached + 1e-15 * np.abs(reached)):
                if bounds[step, output] > reached[output]:
                    powers = sign * (self._powers[:, self._output[output]] @ Z[step])
                    reached[output] = max(reached[output], largest(powers, theta if step == len(Z) - 1 else 1.0))
            extremes.append(sign * reached)
        return extremes[0], extremes[1]
