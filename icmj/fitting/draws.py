"""Draws of a bank: members of a family, and summaries of the trials that each stood."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from icmj.base.array import Array
from icmj.base.environment import single_threaded
from icmj.base.parquet import read_parquet
from icmj.base.text import one_line
from icmj.errors import IcmjError
from icmj.fitting.family import DURATION, RATE, Family, load_family
from icmj.fitting.summaries import SUMMARIES, summarise
from icmj.work.folder import Folder

MOST_OF_FILE = 10_000
"""Draws of one file, at most."""
_NUMBER = 8  # bytes
T = TypeVar("T")


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


class Reader:
    """Reads the files of draws in the folder of a bank."""

    def __init__(self, folder: Folder, parameters: int, trials: int) -> None:
        self._folder, self._p, self._trials = folder, parameters, trials

    def count(self, path: Path) -> int:
        """Draws in a file; none if it is not there.

        Raises:
            FitError: if it cannot be read, or is not as it was written.
        """
        return self._parsed(path, ["draw"], len) if os.path.lexists(path) else 0

    def read(self, path: Path, first: int) -> tuple[Array, Array, Array]:
        """``fell`` (n,), ``theta`` (n, p) and ``summaries`` (n, K, s) of the draws from ``first`` on.

        Raises:
            FitError: if it cannot be read, is not as it was written, or holds something else.
        """

        def checked(table: pa.Table) -> tuple[Array, Array, Array]:
            n, s = len(table), len(SUMMARIES)
            if table["draw"].to_pylist() != list(range(first, first + n)):
                raise ValueError("has other draws than its name says")
            if table["fell"].type != pa.bool_() or table["fell"].null_count:
                raise ValueError("does not say of each draw whether it fell")
            fell = table["fell"].to_numpy()
            theta, summaries = _lists(table["theta"], self._p), _lists(table["summaries"], self._trials * s)
            if not (np.isfinite(theta).all() and np.array_equal(np.isfinite(summaries).all(axis=1), ~fell)):
                raise ValueError("holds values that are not finite")
            return fell, theta, summaries.reshape(n, self._trials, s)

        return self._parsed(path, ["draw", "fell", "theta", "summaries"], checked)

    def _parsed(self, path: Path, columns: list[str], check: Callable[[pa.Table], T]) -> T:
        most = 2 * _NUMBER * (self._p + self._trials * len(SUMMARIES) + 2) * MOST_OF_FILE

        def parse(content: bytes) -> T:
            # numbers that were drawn cannot be compressed: what has few bytes has few rows
            return check(read_parquet(content, min(MOST_OF_FILE, len(content) // _NUMBER), most, columns))

        return self._folder.read(path, most, parse)


def _lists(column: pa.ChunkedArray, width: int) -> Array:
    """A column of lists of so many numbers, shape (n, width)."""
    lists = column.combine_chunks()
    if not pa.types.is_list(lists.type) or lists.type.value_type != pa.float64():
        raise ValueError(f"has a column of {one_line(lists.type, 60)}, not of numbers")
    values = lists.flatten()
    if lists.null_count or values.null_count or not pc.all(pc.equal(pc.list_value_length(lists), width)).as_py():
        raise ValueError(f"has rows of other sizes than {width}")
    return np.asarray(values.to_numpy(zero_copy_only=False)).reshape(-1, width)


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
