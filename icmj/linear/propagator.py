"""The exact propagation of ż = M z on a fine grid, with a polynomial for every step that is exact to round-off.

Oscillators may drive it, ż = M z + W a cos(ωt + φ). Each is two states more, a cos and a sin, and there may be
hundreds. They only turn, so nothing is ever multiplied by a matrix of their number squared.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers

_STEP_NORM = 2.0  # ‖M h‖ of one step: the terms of its series stay below 2, so nothing cancels
_LONGEST_SERIES = 48
_BLOCK = 64  # steps advanced by one matrix product


def exponential(M: Array) -> Array:
    """e^M, balanced first: where states differ by orders of magnitude, SciPy alone loses two digits.

    What does not act on a state, by no way through others, keeps an exact zero: round-off of x must not leak into d.
    """
    from scipy.linalg import expm, matrix_balance

    balanced, (scale, _) = matrix_balance(M, permute=False, separate=True)
    acts = np.eye(len(M), dtype=bool) | (M != 0)
    for _ in range(len(M).bit_length()):
        acts = acts @ acts
    return np.where(acts, expm(balanced) * (scale[:, None] / scale), 0.0)


class Propagator:
    """z(t + θh) = Σ_j (M h)^j/j! z(t) θ^j, θ in [0, 1], the matrix exponential's series cut below round-off.

    The whole state is (z, a cos, a sin), with the oscillators' states last, and G is the generator of it all.

    Attributes:
        M: generator of z, shape (n, n).
        size: length m of the whole state, n + 2K.
        h: step [s]; ‖M h‖₂ after balancing and ωh are at most 2.
        degree: N of the series; its last two terms are below 1e-18 of the sum, entry by entry.
        block: steps that :meth:`states` advances at most.
    """

    def __init__(
        self, M: Array, longest: float = 1e3, *, drive: Array | None = None, omega: Array | None = None
    ) -> None:
        """Prepare for ``M``.

        Args:
            M: shape (n, n).
            longest: longest step [s].
            drive, omega: W, shape (n, K), and ω [rad/s], shape (K,); no oscillators if ``None``.
        """
        from scipy.linalg import matrix_balance

        self.M = np.asarray(M, dtype=float)
        self._n = n = len(self.M)
        self._omega = np.zeros(0) if omega is None else np.asarray(omega, dtype=float)
        W = np.zeros((n, 0)) if drive is None else np.asarray(drive, dtype=float)
        self.size = n + 2 * len(self._omega)
        balanced = matrix_balance(self.M, permute=False)[0]
        fastest = max(float(np.linalg.norm(balanced, 2)), float(self._omega.max(initial=0.0)), 1e-300)
        self.h = min(_STEP_NORM / fastest, longest)
        self._generator, self._drive, self._angle = self.M * self.h, W * self.h, self._omega * self.h
        series = [np.eye(n, self.size)]
        series.append(self._before(series[0]))
        total = np.abs(series[0]) + np.abs(series[1])
        turn = self._angle.max(initial=0.0)  # bounds the terms of the oscillators' own series
        small = 0
        while small < 2 and len(series) < _LONGEST_SERIES:
            series.append(self._before(series[-1]) / len(series))
            turn *= self._angle.max(initial=0.0) / (len(series) - 1)
            # entry by entry, hence in any scaling of the states
            small = small + 1 if np.all(np.abs(series[-1]) <= 1e-18 * total) and turn <= 1e-18 else 0
            total += np.abs(series[-1])
        self.degree, self.block = len(series) - 1, _BLOCK
        self._series = np.array(series)
        steps = np.arange(_BLOCK + 1)[:, None] * self._angle
        self._cos, self._sin = np.cos(steps), np.sin(steps)

    @cached_property
    def _powers(self) -> Array:
        """The whole state to z at the ends of a block's steps, one under the other."""
        from scipy.linalg import expm

        n = self._n
        first = np.hstack([expm(self._generator), self._series[:, :, n:].sum(axis=0)])
        powers = [np.eye(n, self.size), first]
        while len(powers) <= _BLOCK:
            last = first[:, :n] @ powers[-1]
            if len(self._omega):
                last[:, n:] += self._turned(first[:, n:], len(powers) - 1)
            powers.append(last)
        return np.array(powers).reshape(-1, self.size)

    def states(self, z: Array, steps: int = _BLOCK) -> Array:
        """The state at the ends of so many steps from ``z``, itself first; shape (steps + 1, m)."""
        if not len(self._omega):
            return (self._powers @ z).reshape(-1, len(z))[: steps + 1]
        n, K = self._n, len(self._omega)
        moved = (self._powers[: (steps + 1) * n] @ z).reshape(-1, n)
        cos, sin = self._cos[: steps + 1], self._sin[: steps + 1]
        a, b = z[n : n + K], z[n + K :]
        return np.hstack([moved, cos * a - sin * b, sin * a + cos * b])

    def within(self, Z: Array, theta: Array) -> Array:
        """The state at fractions ``theta`` (S,) of the steps that start at ``Z`` (S, m); shape (S, m)."""
        if not len(self._omega):
            terms = (self._series.reshape(-1, self.size) @ Z.T).reshape(self.degree + 1, -1, len(Z))
            return np.asarray(np.einsum("ds,dns->sn", theta ** np.arange(self.degree + 1)[:, None], terms))
        n, K = self._n, len(self._omega)
        moved = np.zeros((n, len(Z)))
        for terms in (self._series.reshape(-1, self.size) @ Z.T).reshape(self.degree + 1, n, len(Z))[::-1]:
            moved *= theta
            moved += terms
        cos, sin = np.cos(theta[:, None] * self._angle), np.sin(theta[:, None] * self._angle)
        a, b = Z[:, n : n + K], Z[:, n + K :]
        return np.hstack([moved.T, cos * a - sin * b, sin * a + cos * b])

    def powers_of(self, C: Array) -> Array:
        """Maps the state at a step's start to the power coefficients of C z(θ); shape (degree + 1, rows of C, m).

        ``C`` has m columns, those of the oscillators zero.
        """
        return C[:, : self._n] @ self._series

    def controls_of(self, C: Array) -> Array:
        """Maps the state at a step's start to the Bernstein coefficients of C z(θ); as :meth:`powers_of`."""
        return np.einsum("ij,jrm->irm", from_powers(self.degree), self.powers_of(C))

    def _before(self, rows: Array) -> Array:
        """``rows`` G h, shape (r, m)."""
        n, K = self._n, len(self._omega)
        z = rows[:, :n]
        if not K:
            return z @ self._generator
        cos, sin = rows[:, n : n + K], rows[:, n + K :]
        return np.hstack([z @ self._generator, z @ self._drive + sin * self._angle, -cos * self._angle])

    def _turned(self, rows: Array, steps: int) -> Array:
        """The oscillators' part of ``rows`` times so many steps of their turning, shape (r, 2K)."""
        K = len(self._omega)
        cos, sin = np.cos(steps * self._angle), np.sin(steps * self._angle)
        a, b = rows[:, :K], rows[:, K:]
        return np.hstack([a * cos + b * sin, b * cos - a * sin])
