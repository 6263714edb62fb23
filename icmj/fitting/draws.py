"""Draws of a bank: members of a family, and summaries of the trials that each stood."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.array import Array
from icmj.base.environment import single_threaded
from icmj.errors import IcmjError
from icmj.fitting.family import DURATION, RATE, Family, load_family
from icmj.fitting.summaries import SUMMARIES, summarise


@dataclass(frozen=True)
class BankPlan:
    """The definition of a bank, which workers receive.

    Attributes:
        path: of the family file, or its name.
        seed: of draws and noise.
        trials: of each draw.
        duration: of a trial [s].
    """

    path: str
    seed: int
    trials: int
    duration: float


def rows(plan: BankPlan, draws: range, progress: Callable[[float], None] | None = None) -> bytes:
    """A Parquet file of some draws, computed with one thread of linear algebra, so that the load changes no bit."""
    family = FAMILIES.get(plan.path)
    found: dict[str, list[Any]] = {"draw": [], "fell": [], "theta": [], "summaries": []}
    with single_threaded():
        for draw in draws:
            theta = family.prior.draw(1, plan.seed, draw)[0]
            S = stood(family, theta, plan.seed, draw, plan.trials, plan.duration)
            found["draw"].append(draw)
            found["fell"].append(S is None)
            found["theta"].append(theta)
            found["summaries"].append(np.full(plan.trials * len(SUMMARIES), np.nan) if S is None else S.ravel())
            if progress is not None:
                progress(len(found["draw"]) / len(draws))
    sink = io.BytesIO()
    pq.write_table(pa.table(found), sink)
    return sink.getvalue()


def stood(family: Family, theta: Array, seed: int, draw: int, trials: int, duration: float = DURATION) -> Array | None:
    """Summaries of the trials of one draw, shape (K, s); ``None`` if it fell in one, or there is no such controller."""
    try:
        member = family.member(theta, duration)
    except IcmjError:
        return None
    found = []
    for trial in range(trials):
        noise = int(np.random.SeedSequence((seed, draw, trial)).generate_state(1, np.uint64)[0] >> np.uint64(2))
        cop = member.trial(noise)
        if cop is None:
            return None
        found.append(summarise(cop, RATE))
    return np.stack(found)


class Families:
    """The family that this process was asked for last."""

    def __init__(self) -> None:
        self.known: dict[str, Family] = {}

    def get(self, path: str) -> Family:
        """The family of a file."""
        if path not in self.known:
            self.known = {path: load_family(path)}
        return self.known[path]


FAMILIES = Families()
