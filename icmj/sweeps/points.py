"""The points of a sweep: a pure function of their index, so that a million of them need no list."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.runfile.sweep_tables import SweepFile, VaryTable

Value = Any
"""What a field of a run file may be: a number, text, true or false, or a list of numbers."""


@dataclass(frozen=True)
class Points:
    """Listed fields as a grid, the last one running fastest; around it, slowest, the samples of those that are drawn.

    Attributes:
        vary: what varies, in the order of the file.
        samples: how many are drawn; 1 where nothing is.
        method: ``sobol`` (scrambled, `scipy.stats.qmc`) or ``random`` (Philox, the index is its counter).
        seed: of both.
    """

    vary: tuple[VaryTable, ...]
    samples: int
    method: str
    seed: int

    @classmethod
    def of(cls, file: SweepFile) -> Points:
        """The points of a sweep file."""
        return cls(tuple(file.vary), file.sweep.samples or 1, file.sweep.method, file.sweep.seed)

    @cached_property
    def lists(self) -> tuple[tuple[Value, ...] | None, ...]:
        """The values of each field; ``None`` where they are drawn."""
        return tuple(None if vary.sampled else _listed(vary) for vary in self.vary)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kind of each field's values: ``number``, ``truth``, or ``text`` for all else."""
        return tuple("number" if listed is None else _kind(listed) for listed in self.lists)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns that vary."""
        return tuple(vary.column for vary in self.vary)

    def __len__(self) -> int:
        return self._grid * self.samples

    @property
    def _grid(self) -> int:
        return prod(len(values) for values in self.lists if values is not None)

    def block(self, start: int, stop: int) -> Iterator[tuple[Value, ...]]:
        """The values of the points ``start`` … ``stop`` − 1, one tuple each, in the order of :attr:`names`."""
        first = start // self._grid
        drawn = self._drawn(first, (stop - 1) // self._grid + 1)
        for index in range(start, stop):
            sample, rest = divmod(index, self._grid)
            at = self._places(rest)
            row, column = drawn[sample - first], 0
            values: list[Value] = []
            for i, listed in enumerate(self.lists):
                if listed is None:
                    values.append(float(row[column]))
                    column += 1
                else:
                    values.append(listed[at[i]])
            yield tuple(values)

    def at(self, index: int) -> tuple[Value, ...]:
        """The values of one point."""
        return next(self.block(index, index + 1))

    def _places(self, rest: int) -> list[int]:
        places = [0] * len(self.lists)
        for i in reversed(range(len(self.lists))):
            listed = self.lists[i]
            if listed is not None:
                rest, places[i] = divmod(rest, len(listed))
        return places

    def _drawn(self, start: int, stop: int) -> Array:
        """Sampled values, shape (stop − start, sampled fields)."""
        fields = [vary for vary in self.vary if vary.sampled]
        if not fields:
            return np.zeros((stop - start, 0))
        uniform = (_sobol if self.method == "sobol" else _random)(len(fields), self.seed, start, stop)
        return np.column_stack([_between(vary, column) for vary, column in zip(fields, uniform.T, strict=True)])


def _listed(vary: VaryTable) -> tuple[Value, ...]:
    if vary.values is not None:
        return tuple(vary.values)
    assert vary.count is not None
    assert vary.low is not None
    assert vary.high is not None
    values = _between(vary, np.linspace(0, 1, vary.count))
    # both ends are as they were written; a field of whole numbers, such as a seed, takes only those
    each = (vary.low, *map(float, values[1:-1]), vary.high)
    return tuple(int(value) if value.is_integer() else value for value in each)


def _kind(listed: tuple[Value, ...]) -> str:
    if all(isinstance(value, bool) for value in listed):
        return "truth"
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in listed)
    return "number" if numbers else "text"


def _between(vary: VaryTable, share: Array) -> Array:
    assert vary.low is not None
    assert vary.high is not None
    if vary.spacing == "log":
        return np.asarray(vary.low * (vary.high / vary.low) ** share)
    return vary.low + (vary.high - vary.low) * share


def _random(fields: int, seed: int, start: int, stop: int) -> Array:
    each = (np.random.Generator(np.random.Philox(key=seed, counter=[0, i, 0, 0])) for i in range(start, stop))
    return np.array([random.random(fields) for random in each]).reshape(stop - start, fields)


def _sobol(fields: int, seed: int, start: int, stop: int) -> Array:
    from scipy.stats.qmc import Sobol

    sequence = Sobol(fields, scramble=True, rng=np.random.default_rng(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a number that is no power of two, which is for the reader to choose
        if start:
            sequence.fast_forward(start)
        return np.asarray(sequence.random(stop - start))
