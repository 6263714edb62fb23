"""The plan of a sweep: its points, and everything that determines its results."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from icmj.case.files import digests, references
from icmj.errors import RunFileError, SweepError
from icmj.runfile.schema import RunFile
from icmj.runfile.sweep_tables import SweepFile
from icmj.sweeps.points import Points, Value
from icmj.work.folder import fingerprint_of
from icmj.work.provenance import versions

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
        outputs: names of the plant's outputs; empty before the sweep was tried (:func:`icmj.sweeps.sweep.tried`).
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
        points = Points.of(file)
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
        for vary, value in zip(self.points.vary, values, strict=True):
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
        for i, (vary, listed) in enumerate(zip(self.points.vary, self.points.lists, strict=True)):
            for value in (vary.low, vary.high) if listed is None else _thinned(listed):
                try:
                    self.run((*middle[:i], value, *middle[i + 1 :]))
                except RunFileError as error:
                    raise RunFileError(f"{self.file.path}: vary {vary.column} = {value!r}: {error}") from error
                except (TypeError, ValueError) as error:
                    raise RunFileError(f"{self.file.path}: vary {vary.column} = {value!r}: {error}") from error


def _named(file: SweepFile) -> Iterator[tuple[str, str]]:
    """Code that sweep file and run file name, with the digest of its source; only if it may be run."""
    for reference in references(file.model_dump(), file.base.model_dump()) if file.base.code.allowed else ():
        if digest := file.base.code.digest(reference):
            yield reference, digest


def _thinned(listed: tuple[Value, ...], most: int = 1000) -> list[Value]:
    """All values, or the first, the last and some between."""
    step = max(1, -(-len(listed) // most))
    return [*listed[::step], listed[-1]]
