"""The path along a curve: its points by arc length, and the polynomials through them, which predict the next point.

The degree of the predicting polynomial is the one that would have predicted the last points best: a low one where the
curve has bent or the points carry rounding, a high one where it is smooth.
"""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array

_FIRST, _HIGHEST = 4, 13  # degrees: up to which nothing is asked, and the highest
_FEW = 3  # derivatives that are all taken
_RECENT = 2  # points that judge a degree
_BENDING = 8  # points through which the derivative is interpolated, at most


class Trail:
    """Points of a curve in the order of continuation.

    Attributes:
        s: length along the curve up to each.
        u: where each is, better than it was flown by what the flight showed, shapes (m,).
        known: numbers of the points whose derivative D is known, rising.
        D: these derivatives.
    """

    def __init__(self, u: Array) -> None:
        self.s, self.u = [0.0], [u]
        self.known: list[int] = []
        self.D: list[Array] = []
        self._errors: list[Array] = []  # of the last points, by degree
        self._wrong: list[Array] = []  # of the last derivatives, by how many points gave them

    def __len__(self) -> int:
        return len(self.s)

    def add(self, u: Array, length: float) -> None:
        """Append a point at a distance ``length`` from the last."""
        s = self.s[-1] + length
        errors = np.full(_HIGHEST + 1, np.inf)
        for degree in range(1, min(len(self), _HIGHEST + 1, self.degree + 3)):
            errors[degree] = np.abs(self._ahead(degree, s)[:-1] - u[:-1]).max()
        self._errors = [*self._errors[1 - _RECENT :], errors]
        self.s.append(s)
        self.u.append(u)

    def cut(self, length: int) -> None:
        """Forget all but the first ``length`` points."""
        del self.s[length:], self.u[length:]
        kept = sum(i < length for i in self.known)
        del self.known[kept:], self.D[kept:]

    def derive(self, i: int, D: Array) -> None:
        """The derivative at a point beyond those at which it is known."""
        errors = np.full(_BENDING + 1, np.inf)
        for count in range(2, min(len(self.known), _BENDING) + 1):
            errors[count] = np.abs(self._flat(self.s[i], count) - D.reshape(-1)).max()
        self._wrong = [*self._wrong[1 - _RECENT :], errors]
        self.known.append(i)
        self.D.append(D)

    @property
    def degree(self) -> int:
        """Degree of the predicting polynomial."""
        n = len(self)
        if n <= _FIRST + 1:
            return n - 1
        return int(np.argmin(np.max(self._errors, axis=0)))

    def predict(self, ds: float, tangent: Array) -> Array:
        """The point a length ``ds`` on from the last; along ``tangent`` where there is one point only."""
        if len(self) == 1:
            return np.asarray(self.u[-1] + ds * tangent)
        return self._ahead(self.degree, self.s[-1] + ds)

    def derivative(self, s: float) -> Array:
        """D at arc length s, interpolated through as many neighbours as would have predicted the last ones best."""
        count = len(self.known)
        if count > _FEW:
            count = int(np.argmin(np.max(self._wrong, axis=0)))
        return self._flat(s, count).reshape(self.D[-1].shape)

    def _flat(self, s: float, count: int) -> Array:
        nearest = np.sort(np.argsort(np.abs(np.array([self.s[i] for i in self.known]) - s))[:count])
        where = np.array([self.s[self.known[j]] for j in nearest])
        return interpolate(where, np.array([self.D[j].reshape(-1) for j in nearest]), s)

    def between(self, i: int, s: float) -> Array:
        """The point at a length s between points i and i + 1."""
        first = max(min(i + 4, len(self)) - _FIRST - 2, 0)
        chosen = slice(first, first + _FIRST + 2)
        return interpolate(np.array(self.s[chosen]), np.array(self.u[chosen]), s)

    def slope(self) -> Array:
        """du/ds at the last point."""
        recent = min(len(self), _FIRST + 1)
        s, u = np.array(self.s[-recent:]), np.array(self.u[-recent:])
        h = 1e-3 * (s[-1] - s[-2])
        return np.asarray((interpolate(s, u, s[-1] + h) - interpolate(s, u, s[-1] - h)) / (2 * h))

    def _ahead(self, degree: int, s: float) -> Array:
        return interpolate(np.array(self.s[-degree - 1 :]), np.array(self.u[-degree - 1 :]), s)


def interpolate(s: Array, values: Array, at: float) -> Array:
    """The polynomial through (s_i, values_i) at a place; shapes (k,), (k, m) → (m,)."""
    gaps = s[:, None] - s[None, :]
    np.fill_diagonal(gaps, 1.0)
    ratios = (at - s)[None, :] / gaps
    np.fill_diagonal(ratios, 1.0)
    return np.asarray(ratios.prod(axis=1) @ values)
