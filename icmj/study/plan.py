"""The plan of a sweep: its points, and everything that determines its results.

The points of a sweep are a pure function of their index, so that a million of them need no list.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.blas_threads import ignore_warnings
from icmj.case.references import digests, references
from icmj.errors import RunFileError, SweepError
from icmj.runfile.schema import RunFile
from icmj.runfile.sweep_tables import SweepFile, VaryTable
from icmj.work.folder import fingerprint_of
from icmj.work.provenance import versions

Value = Any
"""What a field of a run file may be: a number, text, true or false, or a list of numbers."""


@dataclass(frozen=True)
class Points:
    """Listed fields as a grid, the last one running fastest; around it, slowest, the samples of those that are drawn.

    Samples are drawn as a scrambled Sobol sequence (`scipy.stats.qmc`) or at random (Philox, the index is its counter).

    Attributes:
        file: the sweep file, which says what varies and how it is drawn.
    """

    file: SweepFile

    @cached_property
    def lists(self) -> tuple[tuple[Value, ...] | None, ...]:
        """The values of each field, in the order of the file; ``None`` where they are drawn."""
        return tuple(None if vary.sampled else _listed(vary) for vary in self.file.vary)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kind of each field's values: ``number``, ``truth``, or ``text`` for all else."""
        return tuple("number" if listed is None else _kind(listed) for listed in self.lists)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns that vary."""
        return tuple(vary.column for vary in self.file.vary)

    def __len__(self) -> int:
        return self._grid * (self.file.sweep.samples or 1)

    @property
    def _grid(self) -> int:
        return prod(self._shape)

    @property
    def _shape(self) -> list[int]:
        return [len(listed or (None,)) for listed in self.lists]  # a field that is drawn has one place

    def block(self, start: int, stop: int) -> Iterator[tuple[Value, ...]]:
        """The values of the points ``start`` … ``stop`` − 1, one tuple each, in the order of :attr:`names`."""
        first = start // self._grid
        drawn = self._draw(first, (stop - 1) // self._grid + 1)
        for index in range(start, stop):
            sample, rest = divmod(index, self._grid)
            places, row = np.unravel_index(rest, self._shape), iter(drawn[sample - first].tolist())
            each = zip(self.lists, places, strict=True)
            yield tuple(next(row) if listed is None else listed[place] for listed, place in each)

    def at(self, index: int) -> tuple[Value, ...]:
        """The values of one point."""
        return next(self.block(index, index + 1))

    def _draw(self, start: int, stop: int) -> Array:
        """Sampled values, shape (stop − start, sampled fields)."""
        sweep, fields = self.file.sweep, [vary for vary in self.file.vary if vary.sampled]
        if not fields:
            return np.zeros((stop - start, 0))
        uniform = (_sobol if sweep.method == "sobol" else _random)(len(fields), sweep.seed, start, stop)
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
    with ignore_warnings():  # of a number that is no power of two, which is for the reader to choose
        if start:
            sequence.fast_forward(start)
        return np.asarray(sequence.random(stop - start))


FORMAT = 1
_CHUNKS = 64  # at least, where there are points enough: so that processes end together
_LARGEST = {False: 500, True: 25}  # points of a chunk without and with simulation: a few seconds of work
_TRIED = 5  # points that are tried before a sweep starts


@dataclass(frozen=True)
class Plan:
    """A sweep file with its base run and its points.

    Attributes:
        file: the sweep file.
        points: all points.
        chunk: points of one task.
        code: digests of the user's own source files, by the ``module:name`` that the files give.
        outputs: names of the plant's outputs; empty before the sweep was tried (:func:`icmj.study.sweep.try_plan`).
        measures: names of the numbers that the user's own measures return, likewise.
        units: units of what varies and of the outputs, by name, where they are known, likewise.
    """

    file: SweepFile
    points: Points
    chunk: int
    code: Mapping[str, str] = field(default_factory=dict)
    outputs: tuple[str, ...] = ()
    measures: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, file: SweepFile) -> Plan:
        """The plan of a sweep file.

        Raises:
            RunFileError: if there are too many points, or a value is not allowed where it is put.
        """
        points = Points(file)
        if len(points) > 10**9:
            raise RunFileError(f"{file.path}: {len(points):.3g} points; expected at most 1e9")
        largest = _LARGEST[bool(file.ask.motion or file.ask.attractors or file.ask.cycle)]
        chunk = file.sweep.chunk or max(1, min(largest, len(points) // _CHUNKS))
        plan = cls(file, points, chunk, dict(_named(file)))
        plan._check_values()
        return plan

    def __len__(self) -> int:
        return len(self.points)

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-len(self.points) // self.chunk)

    def range(self, chunk: int) -> range:
        """The points of one chunk, by index."""
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, len(self.points)))

    def run(self, values: tuple[Value, ...]) -> RunFile:
        """The run file of one point.

        Raises:
            RunFileError: if a value is not allowed there.
        """
        changes: dict[str, Any] = {}
        deviations: list[dict[str, Any]] = []
        for vary, value in zip(self.file.vary, values, strict=True):
            changes |= dict.fromkeys(vary.fields, value)
            if vary.change is not None:
                of = {} if vary.change.of is None else {"of": vary.change.of}
                deviations.append({"what": vary.change.what, **of, vary.change.by: value})
        if deviations:
            kept = [table.model_dump(exclude_none=True) for table in self.file.base.actual.change]
            changes["actual.change"] = kept + deviations
        return self.file.base.with_(**changes)

    def expect_same_code(self) -> None:
        """Check that this process finds the code from which the sweep was planned.

        Raises:
            SweepError: if a source file is missing or another one.
        """
        for reference, known in self.code.items():
            if self.file.base.code.digest(reference) != known:
                raise SweepError(f"{reference}: its source is not the one with which the sweep began; start it again")

    def tried(self) -> list[int]:
        """A few points from all over the sweep."""
        return sorted({round(i * (len(self) - 1) / (_TRIED - 1)) for i in range(_TRIED)})

    @cached_property
    def identity(self) -> dict[str, Any]:
        """Everything that determines the results: sweep file, run file, all files these name; versions are separate."""
        base = self.file.base
        data = self.file.model_dump(exclude={"sweep": {"title", "name", "run"}})
        run = base.model_dump(exclude={"case"})
        files = digests(base)
        middle = self.points.at(0)
        for i, listed in enumerate(self.points.lists):
            for value in listed or ():
                if '"' in json.dumps(value, default=str):  # a text may be the name of a file
                    files |= digests(self.run((*middle[:i], value, *middle[i + 1 :])))
        code = {"code": dict(self.code)} if self.code else {}
        return {"format": FORMAT, "sweep": data, "chunk": self.chunk, "run": run, "files": files, **code}

    @cached_property
    def fingerprint(self) -> str:
        """Sixteen hexadecimal digits of :attr:`identity`."""
        return fingerprint_of(self.identity)

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """The metadata of every file of the dataset: texts, fingerprint, versions."""
        return {
            "icmj.format": str(FORMAT),
            "icmj.fingerprint": self.fingerprint,
            "icmj.sweep": self.file.text,
            "icmj.run": self.file.base.text,
            "icmj.points": str(len(self)),
            "icmj.chunk": str(self.chunk),
            "icmj.versions": json.dumps(versions()),
        }

    def _check_values(self) -> None:
        """Check that every value is allowed in its field, one field at a time."""
        middle = list(self.points.at(0))
        for i, (vary, listed) in enumerate(zip(self.file.vary, self.points.lists, strict=True)):
            for value in (vary.low, vary.high) if listed is None else _thin(listed):
                try:
                    self.run((*middle[:i], value, *middle[i + 1 :]))
                except RunFileError as error:
                    raise RunFileError(f"{self.file.path}: with {vary.column} = {value!r}, {error}") from error
                except (TypeError, ValueError) as error:
                    raise RunFileError(f"{self.file.path}: with {vary.column} = {value!r}, {error}") from error


def _named(file: SweepFile) -> Iterator[tuple[str, str]]:
    """Code that sweep file and run file name, with the digest of its source; only if it may be run."""
    for reference in references(file.model_dump(), file.base.model_dump()) if file.base.code.allowed else ():
        if digest := file.base.code.digest(reference):
            yield reference, digest


def _thin(listed: tuple[Value, ...], most: int = 1000) -> list[Value]:
    """All values, or the first, the last and some between."""
    step = max(1, -(-len(listed) // most))
    return [*listed[::step], listed[-1]]
