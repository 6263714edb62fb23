"""Recordings that an experiment analyses, simulated or measured, and the common interface of analyses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from icmj.base.array import Array
from icmj.errors import DataError
from icmj.series.series import Series


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial of an experiment.

    Attributes:
        series: its signals, evenly sampled.
        events: times of the events of its controller [s], shape (K,); empty if it has none, and for people.
        outcome: how a simulated run ended, such as ``completed``; "" for people.
    """

    series: Series
    events: Array = field(default_factory=lambda: np.zeros(0))
    outcome: str = ""


class Finding(Protocol):
    """The interface of the result of an analysis.

    Attributes:
        numbers: numbers by name, with the unit in brackets; NaN if a number could not be determined. The ends of a
            95 % confidence interval of ``P (N m)`` are ``P, from (N m)`` and ``P, to (N m)``.
        deviations: standard deviations of numbers over trials, by the same names; empty with one trial.
        curves: columns of the same length by name, with the unit in brackets.
        words: the result in one sentence.
    """

    @property
    def numbers(self) -> Mapping[str, float]: ...

    @property
    def deviations(self) -> Mapping[str, float]: ...

    @property
    def curves(self) -> Mapping[str, Array]: ...

    @property
    def words(self) -> str: ...


def keep_complete(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings that reached their full duration.

    Raises:
        DataError: if there are none.
    """
    kept = [one for one in recordings if one.outcome in ("", "completed")]
    if not kept:
        ends = ", ".join(sorted({one.outcome for one in recordings}))
        raise DataError(f"no trial to analyse: all {len(recordings)} {ends or 'are missing'}")
    return kept
