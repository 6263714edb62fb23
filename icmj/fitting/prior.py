"""The prior: what is known of a family's numbers before a recording is seen.

Each number is a rising function of a standard normal variable z of its own, so that whatever is said of z keeps the
number's bounds. Inference sees z alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.errors import FitError
from icmj.runfile.family_tables import ParameterTable, PriorTable

_FAR = 7.5  # |z| up to which its share of the distribution is told from 0 and 1


@dataclass(frozen=True)
class Distribution:
    """The distribution of one number.

    Attributes:
        log: whether it is that of the natural logarithm.
        low, high: bounds, of the logarithm where ``log``; infinite where there are none.
        median, deviation: of the normal distribution that is cut there; ``None`` for the uniform one.
    """

    log: bool
    low: float
    high: float
    median: float | None = None
    deviation: float | None = None

    @classmethod
    def of(cls, table: PriorTable) -> Distribution:
        """The distribution that a family file says."""
        log = table.kind.startswith("log")

        def taken(value: float | None, none: float) -> float:
            return none if value is None else float(np.log(value) if log else value)

        median = None if table.median is None else taken(table.median, 0.0)
        return cls(log, taken(table.low, -np.inf), taken(table.high, np.inf), median, table.deviation)

    def to_normal(self, theta: ArrayLike) -> Array:
        """z of numbers, at most ±7.5; NaN of what lies beyond the bounds."""
        from scipy.special import ndtr, ndtri

        with np.errstate(invalid="ignore", divide="ignore"):
            value = np.log(theta) if self.log else np.asarray(theta, dtype=float)
        reach = 1e-9 * (1 + np.abs(value))
        inside = (value >= self.low - reach) & (value <= self.high + reach)
        if self.median is None or self.deviation is None:
            share = (value - self.low) / (self.high - self.low)
        else:
            a, b = ndtr(self._ends)
            share = (ndtr((value - self.median) / self.deviation) - a) / (b - a)
        return np.where(inside, np.clip(ndtri(np.clip(share, 0.0, 1.0)), -_FAR, _FAR), np.nan)

    def from_normal(self, z: ArrayLike) -> Array:
        """The numbers of z."""
        from scipy.special import ndtr, ndtri

        share = ndtr(np.clip(np.asarray(z, dtype=float), -_FAR, _FAR))
        if self.median is None or self.deviation is None:
            value = self.low + (self.high - self.low) * share
        else:
            a, b = ndtr(self._ends)
            value = np.clip(self.median + self.deviation * ndtri(a + (b - a) * share), self.low, self.high)
        return np.asarray(np.exp(value) if self.log else value)

    @property
    def _ends(self) -> Array:
        assert self.median is not None
        assert self.deviation is not None
        return (np.array([self.low, self.high]) - self.median) / self.deviation


@dataclass(frozen=True, eq=False)
class Prior:
    """The prior of p numbers, independent of each other.

    Attributes:
        names, units, titles: of the numbers, length p.
        sources: where what is known of each comes from.
        distributions: of each.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    titles: tuple[str, ...]
    sources: tuple[str, ...]
    distributions: tuple[Distribution, ...]

    @classmethod
    def of(cls, tables: Sequence[ParameterTable]) -> Prior:
        """The prior that a family file says."""
        return cls(
            tuple(table.name for table in tables),
            tuple(table.unit for table in tables),
            tuple(table.title or table.name for table in tables),
            tuple(table.source for table in tables),
            tuple(Distribution.of(table.prior) for table in tables),
        )

    def __len__(self) -> int:
        return len(self.names)

    def draw(self, n: int, seed: int = 0, first: int = 0) -> Array:
        """Numbers of ``n`` people, the ``first`` one and those that follow, shape (n, p); each by its number alone."""
        rows = [np.random.default_rng((seed, first + i)).standard_normal(len(self)) for i in range(n)]
        return self.from_normal(np.array(rows).reshape(n, len(self)))

    def to_normal(self, theta: ArrayLike) -> Array:
        """z of numbers, shape (n, p).

        Raises:
            FitError: if one lies where the prior has nothing.
        """
        given = self._given(theta)
        z = np.column_stack([of.to_normal(column) for of, column in zip(self.distributions, given.T, strict=True)])
        wrong = np.argwhere(~np.isfinite(z))
        if len(wrong):
            row, column = wrong[0]
            raise FitError(f"{self.names[column]} = {given[row, column]:g} lies outside its prior")
        return z

    def from_normal(self, z: ArrayLike) -> Array:
        """Numbers of z, shape (n, p)."""
        given = self._given(z)
        return np.column_stack([of.from_normal(column) for of, column in zip(self.distributions, given.T, strict=True)])

    def _given(self, values: ArrayLike) -> Array:
        given = np.asarray(values, dtype=float)
        if given.ndim != 2 or given.shape[1] != len(self):
            raise FitError(f"numbers of shape {given.shape}; expected (n, {len(self)}): {', '.join(self.names)}")
        return given
