"""The folder of a sweep: one complete Parquet file for each chunk, and a description (:mod:`icmj.work.folder`).

    OUT/sweep.json          the description: texts, fingerprint, versions, provenance
    OUT/points/*.parquet    the rows, one file for each finished chunk
    OUT/timing.csv          the time that each chunk took

Rows and files contain neither time nor place, so that they are the same bit for bit on every machine and at every time.
The folder may come from somebody else: what it holds is checked before it is used.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from icmj.base.files import open_regular
from icmj.base.parquet import read_parquet
from icmj.base.text import one_line
from icmj.case.sweep_table import SweepTable
from icmj.errors import SweepError
from icmj.study.chunk import TYPES, ChunkResult, columns, meanings, schema
from icmj.study.plan import Plan
from icmj.study.sweep_facts import Facts, parse_facts
from icmj.work.folder import Description, Folder, resume
from icmj.work.provenance import provenance

WHAT, POINTS, TIMING = "sweep", "points", "timing.csv"
_MOST_OF_ROW, _MOST_OF_CHUNK = 100e3, 500e6  # bytes of a row, and of one chunk, in its file and in memory
_CHUNK = re.compile(r"\d{8,10}")


class Dataset:
    """The folder of one sweep; its description is read and checked.

    Raises:
        SweepError: if it is no such folder.
    """

    def __init__(self, path: Path | str, folder: Folder | None = None) -> None:
        self._folder = folder or Folder(Path(path), SweepError)
        self.facts: Facts = self._folder.describe(WHAT, parse_facts)
        self.path = self._folder.path

    def files(self) -> dict[int, Path]:
        """The files of finished chunks by their number, in order.

        Raises:
            SweepError: if one has a name that none of them has.
        """
        found = {}
        for path in (self.path / POINTS).glob("*.parquet"):
            number = int(path.stem) if _CHUNK.fullmatch(path.stem) and path.stem.isascii() else -1
            if f"{number:08d}" != path.stem or number >= self.facts.chunks:
                raise SweepError(f"{one_line(path, 300)}: not a chunk of this sweep, by its name; remove it")
            found[number] = path
        return dict(sorted(found.items()))

    def chunks(self, only: Sequence[str] = (), schema: pa.Schema | None = None) -> Iterator[tuple[int, pa.Table]]:
        """The finished chunks, their number and rows, in order.

        Args:
            only: columns to read; all if there are none.
            schema: what the columns must be; those of the first chunk if ``None``.

        Raises:
            SweepError: if one cannot be read, or belongs to another sweep.
        """
        known = schema

        def parse(content: bytes) -> pa.Table:
            def check(found: pa.Schema, count: int) -> None:
                nonlocal known
                self._check_columns(found, known)
                if count != len(rows):
                    raise ValueError(f"{count} rows, expected {len(rows)}")
                known = found

            table = read_parquet(content, self.facts.chunk, most, list(only) or None, check)
            _check_values(table, rows, self.facts)
            return table

        files, most = self.files(), min(_MOST_OF_CHUNK, _MOST_OF_ROW * (self.facts.chunk + 100))
        self._folder.expect_readable(files.values())
        for chunk, path in files.items():
            rows = self.facts.rows(chunk)
            yield chunk, self._folder.read(path, most, parse)

    def write(self, chunk: int, computed: ChunkResult) -> None:
        """Write one chunk, and how long it took; this is not essential, and omitted if it cannot be written.

        Raises:
            SweepError: if the chunk cannot be written.
        """
        with self._folder.seal(self.path / POINTS / f"{chunk:08d}.parquet") as part:
            part.write_bytes(computed.content)
        line = f"{chunk},{computed.rows},{computed.failed},{computed.seconds:.4f},{computed.simulating:.4f}\n"
        with suppress(OSError):
            handle = open_regular(self.path / TIMING, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            with os.fdopen(handle, "a", encoding="utf-8") as file:
                file.write(line)

    def _check_columns(self, found: pa.Schema, known: pa.Schema | None) -> None:
        facts = self.facts
        if (found.metadata or {}).get(b"icmj.fingerprint") != facts.fingerprint.encode():
            raise ValueError("of another sweep")
        if known is not None:
            if not found.equals(known):
                raise ValueError("with other columns")
            return
        names = found.names
        asked = {
            what: [plant for plant in ("linear", "mujoco") if f"{plant}_{mark}" in names]
            for what, mark in (("motion", "outcome"), ("cycle", "cycle_found"), ("noisy", "binding"))
        }
        expected = columns(
            [(name, "number") for name in facts.varies], facts.outputs, motion=asked["motion"], cycle=asked["cycle"],
            noisy=bool(asked["noisy"]), attractors="attractors" in names,
            predicted="root_real" not in names, orbits="predicted_orbit_delta" in names,
            gaps="predicted_unresolved" in names, measures=facts.measures,
        )  # fmt: skip
        if names != list(expected):
            raise ValueError("columns that a sweep does not have, or lacks")
        for field in found:
            types = TYPES.values() if field.name in facts.varies else [expected[field.name][0]]
            if field.type not in types:
                raise ValueError(f"column {field.name} of {field.type}")


@contextmanager
def resume_sweep(path: Path | str | None, plan: Plan) -> Iterator[tuple[Dataset, set[int]]]:
    """The folder of a sweep, new or resumed, and the numbers of the chunks that are finished.

    Raises:
        SweepError: as :func:`icmj.work.folder.resume`, or if a chunk cannot be read, or belongs to another sweep.
    """
    file, base = plan.file, plan.file.base
    more = {
        "name": file.sweep.name,
        "title": file.sweep.title or one_line(f"{base.case.title}, over {', '.join(plan.points.names)}", 200),
        "seed": plan.file.sweep.seed,
        "varies": list(plan.points.names),
        "fields": [vary.fields[0] if vary.fields else "" for vary in plan.file.vary],
        "outputs": list(plan.outputs),
        **({"code": dict(plan.code)} if plan.code else {}),
        "measures": list(plan.measures),
        "units": dict(plan.units),
        "columns": {name: meaning for name, (_, meaning) in meanings(plan).items()},
        "provenance": provenance(file.path.parent),
        "sweep": file.text,
        "run": base.text,
        "run_path": base.path.name,
    }
    mark = {"fingerprint": plan.fingerprint, "points": len(plan), "chunk": plan.chunk}
    of = Description(WHAT, POINTS, mark, lambda _: "another sweep file, run file, model or code", more, parse_facts)
    with resume(path, of, SweepError, beside=(TIMING,)) as folder:
        dataset = Dataset(folder.path, folder)
        yield dataset, {chunk for chunk, _ in dataset.chunks(["point", "status"], schema(plan))}


def read_sweep(folder: Path | str) -> SweepTable:
    """Read the finished part of a sweep, with the data that its figures need.

    Raises:
        SweepError: if the folder is not that of a sweep, no chunk is finished, or a file is damaged.
    """
    facts = Dataset(folder).facts
    varies = tuple(zip(facts.varies, facts.fields, strict=True))
    return SweepTable(facts.name, facts.title or facts.name, varies, facts.points, read_table(folder), facts.units)


def read_table(folder: Path | str) -> pa.Table:
    """All rows of a folder that are there, in order, as one table.

    Raises:
        SweepError: if there is none, or a file of it cannot be read.
    """
    tables = [table for _, table in Dataset(folder).chunks()]
    if not tables:
        raise SweepError(f"{folder}: no point is finished there")
    return pa.concat_tables(tables)


def statuses(folder: Path) -> Counter[str]:
    """Number of rows of each status, one file at a time.

    Raises:
        SweepError: as :func:`read_table`.
    """
    found: Counter[str] = Counter()
    for _, table in Dataset(folder).chunks(["point", "status"]):
        found.update(table["status"].to_pylist())
    return found


def _check_values(table: pa.Table, rows: range, facts: Facts) -> None:
    """Check the order and status of points, that varied values are finite, and that a cycle has an interval."""
    names = table.column_names
    if "point" in names and table["point"].to_pylist() != list(rows):
        raise ValueError("with other points")
    for name in ("status", "words"):
        if name in names and table[name].null_count:
            raise ValueError(f"without {name}")
    for name in facts.varies:
        if name in names and (
            table[name].null_count
            or (table[name].type == TYPES["number"] and not pc.all(pc.is_finite(table[name])).as_py())
        ):
            raise ValueError(f"column {name} has gaps")
    for plant in ("linear", "mujoco"):
        needed = [f"{plant}_{name}" for name in ("kind", "interval", "p")]
        if not set(needed) <= set(names):
            continue
        cycle = table.filter(pc.fill_null(pc.equal(table[needed[0]], "cycle"), False))
        interval = cycle[needed[1]].to_numpy(zero_copy_only=False)
        if cycle[needed[2]].null_count or not (np.isfinite(interval) & (interval > 0)).all():
            raise ValueError(f"a cycle without {plant}_interval")
