"""Pairs of steps of a set-point: generated in random order for an experiment, or detected in a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le, Len

from icmj.base.array import MOST_ENTRIES, Array, Finite, Positive, Seed
from icmj.controller.setpoint import Target, step
from icmj.errors import AnalysisError, DataError
from icmj.series.series import Series

DIRECTIONS = {"same": 1.0, "reversal": -2.0}  # size of the second step in first ones
_STILL = 1e-3  # of the largest step: what moves less between two rows stands still


@dataclass(frozen=True, eq=False)
class StepPairs:
    """P pairs of steps of a set-point.

    Attributes:
        t: times of first and second steps [s], shape (P, 2), increasing throughout.
        sizes: sizes of the steps [unit of the set-point], shape (P, 2).

    Raises:
        AnalysisError: on construction, if there is no pair, times do not increase, or a step has the size zero.
    """

    t: Array
    sizes: Array

    def __post_init__(self) -> None:
        t, sizes = np.asarray(self.t, dtype=float), np.asarray(self.sizes, dtype=float)
        if t.ndim != 2 or t.shape[1:] != (2,) or not len(t) or sizes.shape != t.shape:
            raise AnalysisError(
                f"pairs of steps: times {t.shape} and sizes {sizes.shape}; expected (P, 2) twice, P > 0"
            )
        if not (np.isfinite(t).all() and (np.diff(t.ravel()) > 0).all()):
            raise AnalysisError("pairs of steps: times must be finite and rise from step to step")
        if not (np.isfinite(sizes).all() and sizes.all()):
            raise AnalysisError("pairs of steps: sizes must be finite and not zero")
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "sizes", sizes)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def isi(self) -> Array:
        """Inter-step interval, from the first to the second step of each pair [s], shape (P,)."""
        return np.diff(self.t, axis=1)[:, 0]

    @property
    def same(self) -> np.ndarray:
        """Whether both steps of a pair have the same direction, shape (P,)."""
        return self.sizes.prod(axis=1) > 0

    @property
    def end(self) -> float:
        """End of the last step plus the smallest pause between pairs [s]."""
        between = self.t[1:, 0] - self.t[:-1, 1]
        return float(self.t[-1, 1] + (between.min() if len(between) else 2.0))

    @property
    def terms(self) -> Array:
        """The terms of ṙ(t) in the form of :class:`icmj.Target`, shape (2P, 5)."""
        return np.concatenate([step(size, at) for size, at in zip(self.sizes.ravel(), self.t.ravel(), strict=True)])

    def target(self, output: str) -> Target:
        """The set-point of ``output`` with these steps, for :func:`icmj.setpoint`."""
        return Target({output: 1.0}, self.terms)


def double_steps(
    isi: Annotated[Sequence[Positive], Len(1, MOST_ENTRIES)],
    repetitions: Annotated[int, Ge(1), Le(10_000)] = 5,
    size: Finite = 1.0,
    *,
    recovery: tuple[Positive, Positive] = (2.0, 3.0),
    directions: Annotated[Sequence[Literal["same", "reversal"]], Len(1, 2)] = ("same", "reversal"),
    seed: Seed = 0,
    start: Positive = 1.0,
) -> StepPairs:
    """Pairs of steps in random order, each inter-step interval and direction ``repetitions`` times.

    A reversal is twice as large as the step before it. If it were equally large, a controller that samples both steps
    at once would find no change. The magnitude of the set-point is at most three times ``size``.

    Args:
        isi: inter-step intervals, from the first to the second step [s].
        repetitions: number of repetitions of each interval in each direction.
        size: size of the first step of each pair [unit of the output].
        recovery: shortest and longest time from a pair to the next [s]. Times are uniformly distributed between them,
            so that the times of the pairs are not related to any clock.
        directions: directions of the second step. A reversal is twice as large as the step before it.
        seed: seed of order, directions and times.
        start: time before the first pair [s].

    Raises:
        AnalysisError: if intervals are not positive or occur twice, or another argument is invalid.
    """
    intervals = np.asarray(isi, dtype=float).ravel()
    if (
        not len(intervals)
        or not (np.isfinite(intervals) & (intervals > 0)).all()
        or len(set(intervals)) < len(intervals)
    ):
        raise AnalysisError(f"inter-step intervals must be positive, each once; got {intervals.tolist()} s")
    unknown = [name for name in directions if name not in DIRECTIONS]
    if unknown or not directions or len(set(directions)) < len(directions):
        raise AnalysisError(f"directions {list(directions)}; expected some of {', '.join(DIRECTIONS)}, each once")
    if repetitions < 1:
        raise AnalysisError(f"{repetitions} repetitions; expected at least one")
    low, high = recovery
    if not (np.isfinite(high) and 0 < low <= high and np.isfinite(start) and start > 0):
        raise AnalysisError(f"recovery of {low:g} to {high:g} s from {start:g} s on; expected positive, rising times")
    random = np.random.default_rng(seed)
    plan = [(interval, DIRECTIONS[name]) for interval in intervals for name in directions] * repetitions
    t, sizes, now, level = [], [], start, 0.0
    for index in random.permutation(len(plan)):
        interval, second = plan[index]
        now += (high - low) * random.random()
        toward = -np.sign(level * (1 + second))
        first = toward if toward else random.choice((-1.0, 1.0))
        level += first * (1 + second)
        t.append((now, now + interval))
        sizes.append((first * size, first * second * size))
        now += interval + low
    return StepPairs(np.array(t), np.array(sizes))


def find_step_pairs(series: Series, setpoint: str) -> StepPairs:
    """The pairs of steps in a recorded set-point: the first step with the second, the third with the fourth, …

    The time of a step is that of the first row after it, so it may be late by up to one sampling interval.

    Args:
        series: the series that contains the set-point.
        setpoint: name of this signal.

    Raises:
        DataError: if there is no such signal, it has gaps, it changes other than in steps, or a step has no partner.
    """
    r = series[setpoint]
    if not np.isfinite(r).all():
        raise DataError(
            f"{setpoint}: {int((~np.isfinite(r)).sum())} values are missing; a set-point must be known throughout"
        )
    moved = np.diff(r)
    largest = np.abs(moved).max(initial=0.0)
    at = np.flatnonzero(np.abs(moved) > _STILL * largest) + 1
    if not len(at):
        raise DataError(f"{setpoint}: never moves; a double-step experiment needs a set-point with pairs of steps")
    if (np.diff(at) == 1).any():
        first = float(series.t[at[np.flatnonzero(np.diff(at) == 1)[0]]])
        raise DataError(f"{setpoint}: moves from row to row at {first:.6g} s; expected steps with rest between them")
    if len(at) % 2:
        raise DataError(
            f"{setpoint}: {len(at)} steps, so one has no partner; cut the record so that it holds whole pairs"
        )
    return StepPairs(series.t[at].reshape(-1, 2), moved[at - 1].reshape(-1, 2))
