"""The bank: a family's numbers drawn from its prior, and summaries of trials that they stood.

    FOLDER/bank.json          the description: family, numbers, versions
    FOLDER/draws/*.parquet    the rows, one file for each finished chunk

A draw depends on its number and the bank's seed alone: rows are the same bit for bit whatever the chunks and whoever
computes them, and a bank of more draws begins with those of one of fewer.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from icmj.base.array import Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.parquet import read_parquet
from icmj.base.text import one_line, parse_json
from icmj.errors import FitError, IcmjError
from icmj.fits.family import DURATION, RATE, TRIALS, Family, Prior, load_family
from icmj.fits.summaries import SUMMARIES, summarise
from icmj.work.folder import Description, Folder, resume
from icmj.work.workers import crew

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


def rows(
    plan: BankPlan, draws: range, progress: Callable[[float], None] | None = None, family: Family | None = None
) -> bytes:
    """A Parquet file of some draws, computed with one thread of linear algebra, so that the load changes no bit.

    ``family`` is that of the plan, if it is at hand.
    """
    family = family or load_last(plan.path)
    found: dict[str, list[Any]] = {"draw": [], "fell": [], "theta": [], "summaries": []}
    with limit_to_one_thread():
        for draw in draws:
            theta = family.prior.draw(1, plan.seed, draw)[0]
            S = simulate_draw(family, theta, plan.seed, draw, plan.trials, plan.duration)
            found["draw"].append(draw)
            found["fell"].append(S is None)
            found["theta"].append(theta)
            found["summaries"].append(np.full(plan.trials * len(SUMMARIES), np.nan) if S is None else S.ravel())
            if progress is not None:
                progress(len(found["draw"]) / len(draws))
    sink = io.BytesIO()
    pq.write_table(pa.table(found), sink, write_page_checksum=True)
    return sink.getvalue()


def simulate_draw(
    family: Family, theta: Array, seed: int, draw: int, trials: int, duration: float = DURATION
) -> Array | None:
    """Summaries of the trials of one draw, shape (K, s); ``None`` if it fell in one, is unstable or no controller."""
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


class DrawReader:
    """Reads the files of draws in the folder of a bank."""

    def __init__(self, folder: Folder, parameters: int, trials: int) -> None:
        self._folder, self._p, self._trials = folder, parameters, trials

    def count(self, path: Path) -> int:
        """Draws in a file; none if it is not there.

        Raises:
            FitError: if it cannot be read, or is not as it was written.
        """
        return self._parse(path, ["draw"], len) if os.path.lexists(path) else 0

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
                raise ValueError("lacks for some draws whether they fell")
            fell = table["fell"].to_numpy()
            theta, summaries = _lists(table["theta"], self._p), _lists(table["summaries"], self._trials * s)
            if not (np.isfinite(theta).all() and np.array_equal(np.isfinite(summaries).all(axis=1), ~fell)):
                raise ValueError("holds values that are not finite")
            return fell, theta, summaries.reshape(n, self._trials, s)

        return self._parse(path, ["draw", "fell", "theta", "summaries"], checked)

    def _parse(self, path: Path, columns: list[str], check: Callable[[pa.Table], T]) -> T:
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


@lru_cache(maxsize=1)
def load_last(path: str) -> Family:
    """The family of a file; the one that this process was asked for last is at hand."""
    return load_family(path)


WHAT, DRAWS = "bank", "draws"
CHUNK = 50
MOST = 10_000_000


@dataclass(frozen=True, eq=False)
class Bank:
    """Simulated trials of n draws from the prior of a family, including draws that fell.

    Attributes:
        family: name of the family.
        prior: prior of its parameters.
        fingerprint: fingerprint of family, number of trials and duration; banks with the same fingerprint can be
            combined for training.
        theta: parameters of each draw, shape (n, p).
        summaries: summary statistics of each trial, shape (n, K, s); NaN if a draw fell.
        fell: whether a draw fell in one of its trials, is a continuous controller whose loop is unstable, or has no
            controller, shape (n,).
        seed: seed of the draws and their noise.
        duration: duration of a trial [s].
    """

    family: str
    prior: Prior
    fingerprint: str
    theta: Array
    summaries: Array
    fell: np.ndarray
    seed: int
    duration: float = DURATION

    def __len__(self) -> int:
        return len(self.theta)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.prior.names

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters."""
        return self.prior.units

    @property
    def summary_names(self) -> tuple[str, ...]:
        """Names of the summary statistics."""
        return SUMMARIES

    @property
    def z(self) -> Array:
        """The parameters as standard normal variables, shape (n, p)."""
        return self.prior.to_normal(self.theta)

    @property
    def stood(self) -> Bank:
        """The draws that stood in all their trials and are not unstable, on which a network is trained."""
        kept = ~self.fell
        return replace(self, theta=self.theta[kept], summaries=self.summaries[kept], fell=self.fell[kept])

    @property
    def words(self) -> str:
        """The number of draws and the share of those that are left out, in one sentence."""
        share = 100 * float(np.mean(self.fell)) if len(self) else 0.0
        trials = self.summaries.shape[1]
        return (
            f"{len(self)} draws of {self.family}, each {trials} trials of {self.duration:g} s; {share:.1f} % fell, "
            "or stood with an unstable loop, and are left out: what is inferred is conditional on standing."
        )


def simulate_bank(
    family: Family,
    n: int,
    seed: int = 0,
    *,
    trials: int = TRIALS,
    duration: float = DURATION,
    folder: Path | str | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    chunk: int = CHUNK,
    progress: Callable[[float], None] | None = None,
) -> Bank:
    """Draw members of a family from its prior, simulate quiet standing, and compute summary statistics of the trials.

    Args:
        family: the family.
        n: number of draws.
        seed: seed of draws and noise.
        trials: number of trials of each draw.
        duration: duration of a trial [s], at least 30.
        folder: folder in which finished chunks are stored, and an interrupted bank is resumed; nothing is stored if
            ``None``.
        jobs: number of local processes; by default the number of cores.
        dask: address of a Dask scheduler, whose workers are used instead.
        chunk: number of draws that are stored together.
        progress: called repeatedly with the completed fraction, 0–1.

    Raises:
        FitError: if there is nothing to draw, or the folder contains another bank or cannot be used.
        SweepError: if the cluster cannot be reached or disappears.
    """
    if not (1 <= n <= MOST and 1 <= trials <= 100 and seed >= 0):
        raise FitError(f"{n} draws, {trials} trials, seed {seed}: expected at least one of each, and no negative seed")
    if not 1 <= chunk <= MOST_OF_FILE:
        raise FitError(f"chunks of {chunk} draws; expected 1 to {MOST_OF_FILE}")
    if not 30.0 <= duration <= 3600.0:
        raise FitError(f"trials of {duration:g} s; expected 30 to 3600 s")
    plan = BankPlan(str(family.file.path), seed, trials, duration)
    of = _describe(family, plan)
    # several may write there, each whole files with the same bits
    with resume(folder, of, FitError, again="simulated", instead="choose another folder", alone=False) as home:
        reader, draws = DrawReader(home, len(family.prior), trials), home.path / DRAWS
        parts = [range(first, min(first + chunk, n)) for first in range(0, n, chunk)]
        home.expect_readable(_find_tables(home))
        left = [part for part in parts if reader.count(draws / _name(part.start)) < len(part)]
        done = len(parts) - len(left)
        for part, content, why in _compute(plan, family, left, jobs, dask):
            if content is None:
                raise FitError(f"draws from {part.start} on: a process died ({why}); what is finished is kept")
            with home.seal(draws / _name(part.start)) as target:
                target.write_bytes(content)
            done += 1
            if progress is not None:
                progress(done / len(parts))
        bank = _read_finished(home, family)
        return replace(bank, theta=bank.theta[:n], summaries=bank.summaries[:n], fell=bank.fell[:n])


def read_bank(folder: Path | str, family: Family | None = None) -> Bank:
    """Read the finished part of a bank, from its first draw to the last one before a missing draw.

    Args:
        folder: folder of the bank.
        family: family of the bank; by default it is loaded as the bank states it.

    Raises:
        FitError: if the folder is not that of a bank, the bank belongs to another family, or a file cannot be read.
    """
    home = Folder(Path(folder), FitError, "simulated")
    home.describe(WHAT, _facts)  # first, as what lies in another folder is not read
    home.expect_readable(_find_tables(home))
    return _read_finished(home, family)


def _find_tables(home: Folder) -> list[Path]:
    """Tables of draws in the folder of a bank, in the order of their first draws."""
    return sorted((home.path / DRAWS).glob("[0-9]*.parquet"))


def _read_finished(home: Folder, family: Family | None) -> Bank:
    """The finished part of a bank none of whose tables ends the process that reads it, as of :func:`read_bank`."""
    facts = home.describe(WHAT, _facts)
    family = family or load_family(Path(facts.path))
    if facts.family != _mark(family, facts.trials, facts.duration):
        raise FitError(f"{home.path}: is a bank of another family than {family.file.path}; simulate it anew")
    reader = DrawReader(home, len(family.prior), facts.trials)
    parts: list[tuple[Array, ...]] = []
    count = 0
    for path in _find_tables(home):
        first = int(path.stem) if path.stem.isdecimal() else MOST
        if first > count:
            break
        found = reader.read(path, first)
        parts.append(tuple(column[count - first :] for column in found))
        count = max(count, first + len(found[0]))
    if not count:
        raise FitError(f"{home.path}: no draw is finished there")
    fell, theta, summaries = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Bank(family.name, family.prior, facts.family, theta, summaries, fell, facts.seed, facts.duration)


def _compute(
    plan: BankPlan, family: Family, left: list[range], jobs: int | None, dask: str | None
) -> Iterator[tuple[range, bytes | None, str]]:
    """Parts, and what came of each as it comes; with one process it is this one."""
    if not left:
        return
    if jobs == 1 and dask is None:
        for part in left:
            yield part, rows(plan, part, family=family), ""
        return
    with crew(rows, jobs, dask) as workers:
        yield from workers.compute(plan, iter(left))


def _describe(family: Family, plan: BankPlan) -> Description:
    more = {
        "name": family.name, "path": plan.path, "trials": plan.trials, "duration": plan.duration,
        "summaries": SUMMARIES, "names": family.prior.names, "units": family.prior.units, "text": family.file.text,
        "run": family.file.base.text,
    }  # fmt: skip
    mark = {"family": _mark(family, plan.trials, plan.duration), "seed": plan.seed}
    return Description(WHAT, DRAWS, mark, lambda _: "another family, seed or trials", more, _facts)


def _mark(family: Family, trials: int, duration: float) -> str:
    return f"{family.fingerprint}-{trials}-{duration:g}"


@dataclass(frozen=True)
class _Facts:
    """What a bank's folder says that it is of, as far as it is read again."""

    family: str
    path: str
    seed: int
    trials: int
    duration: float


def _facts(content: bytes) -> _Facts:
    found = parse_json(content)
    facts = _Facts(**{field.name: found[field.name] for field in fields(_Facts)})
    if not (
        isinstance(facts.family, str) and isinstance(facts.path, str)
        and type(facts.seed) is type(facts.trials) is int and type(facts.duration) in (int, float)
        and facts.seed >= 0 and 1 <= facts.trials <= 100 and 30 <= facts.duration <= 3600
    ):  # fmt: skip
        raise ValueError("not what a bank wrote")
    return facts


def _name(first: int) -> str:
    return f"{first:08d}.parquet"
