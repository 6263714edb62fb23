"""The folder of a sweep: one complete Parquet file for each chunk, a description, and a lock during writing.

    OUT/sweep.json          the description: texts, fingerprint, versions, provenance
    OUT/points/*.parquet    the rows, one file for each finished chunk
    OUT/timing.csv          the time that each chunk took
    OUT/SHA256SUMS          digests, without which no file is trusted (:mod:`icmj.base.ledger`)

Rows and files contain neither time nor place, so that they are the same bit for bit on every machine and at every time.
The folder may come from somebody else: its contents are validated (:mod:`icmj.sweeps.validation`), and no link is
followed for writing.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow as pa

from icmj.base.files import clear_leftovers, locked, ready, regular, replaceable
from icmj.base.ledger import SUMS, Ledger
from icmj.errors import SweepError
from icmj.result.swept import Swept
from icmj.sweeps.chunk import Computed
from icmj.sweeps.columns import meanings, schema
from icmj.sweeps.plan import PACKAGES, Plan
from icmj.sweeps.validation import Facts, chunk_files, read_chunk, read_facts
from icmj.work.provenance import provenance, versions

FACTS, POINTS, TIMING = "sweep.json", "points", "timing.csv"


class Dataset:
    """The folder of one sweep, open for writing; see :func:`opened`."""

    def __init__(self, folder: Path, plan: Plan, facts: Facts) -> None:
        self.folder, self._plan, self._facts, self._ledger = folder, plan, facts, Ledger(folder)

    def finished(self) -> set[int]:
        """The numbers of the chunks that are finished.

        Raises:
            SweepError: if a chunk cannot be read, or belongs to another sweep.
        """
        files, columns = chunk_files(self.folder / POINTS, self._facts), schema(self._plan)
        for chunk, path in files.items():
            read_chunk(path, self._plan.range(chunk), self._facts, ["point", "status"], columns, self._ledger)
        return set(files)

    def write(self, chunk: int, content: bytes) -> None:
        """Write one chunk; it is completely on the disk before it gets its final name.

        Raises:
            SweepError: if it cannot be written.
        """
        target = self.folder / POINTS / f"{chunk:08d}.parquet"
        try:
            with self._ledger.seal(target) as part:
                part.write_bytes(content)
            _settle(target.parent)
        except OSError as error:
            raise SweepError(f"{target}: cannot be written: {error.strerror}; what is finished is kept") from error

    def time(self, chunk: int, computed: Computed) -> None:
        """Record how long a chunk took; this is not essential, and omitted if it cannot be written."""
        line = f"{chunk},{computed.rows},{computed.failed},{computed.seconds:.4f},{computed.simulating:.4f}\n"
        with suppress(OSError):
            handle = regular(self.folder / TIMING, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            with os.fdopen(handle, "a", encoding="utf-8") as file:
                file.write(line)


@contextmanager
def opened(folder: Path, plan: Plan) -> Iterator[Dataset]:
    """The folder of a sweep, new or resumed; within the block no other process writes to it.

    Raises:
        SweepError: if another process is at it, or it holds another sweep, or one of other versions, or cannot be
            written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with locked(folder, "sweep"):
            ready(folder)
            facts = _begin(folder, plan)
            points = folder / POINTS
            if points.is_symlink():
                raise SweepError(f"{points}: is a link, not a folder; choose another --out")
            replaceable(folder / TIMING, folder / SUMS)
            points.mkdir(exist_ok=True)
            clear_leftovers(points)
            yield Dataset(folder, plan, facts)
    except BlockingIOError as error:
        raise SweepError(f"{folder}: {error.strerror}, or choose another --out") from error
    except OSError as error:
        raise SweepError(f"{folder}: cannot be written to: {error.strerror}; choose another --out") from error


def read_sweep(folder: Path | str) -> Swept:
    """Read the finished part of a sweep, with the data that its figures need.

    Raises:
        SweepError: if the folder is not that of a sweep, no chunk is finished, or a file is damaged.
    """
    folder = Path(folder)
    facts = read_facts(folder / FACTS)
    varies = tuple(zip(facts.varies, facts.fields, strict=True))
    return Swept(facts.name, facts.title or facts.name, varies, facts.points, read_table(folder))


def read_table(folder: Path) -> pa.Table:
    """All rows of a folder that are there, in order, as one table.

    Raises:
        SweepError: if there is none, or a file of it cannot be read.
    """
    facts = read_facts(folder / FACTS)
    files = chunk_files(folder / POINTS, facts)
    if not files:
        raise SweepError(f"{folder}: no point is finished there")
    tables: list[pa.Table] = []
    ledger = Ledger(folder)
    for chunk, path in files.items():
        schema = tables[0].schema if tables else None
        tables.append(read_chunk(path, facts.rows(chunk), facts, schema=schema, ledger=ledger))
    return pa.concat_tables(tables)


def _begin(folder: Path, plan: Plan) -> Facts:
    """Write the folder's description, or check that it belongs to this sweep."""
    if not os.path.lexists(folder / FACTS):
        if os.path.lexists(folder / POINTS):
            raise SweepError(f"{folder}: has points but no {FACTS} that describes them; choose another --out")
        facts = {
            "fingerprint": plan.fingerprint,
            "name": plan.file.sweep.name,
            "title": plan.file.sweep.title,
            "points": len(plan),
            "chunk": plan.chunk,
            "seed": plan.points.seed,
            "varies": list(plan.points.names),
            "fields": [vary.fields[0] if vary.fields else "" for vary in plan.points.vary],
            "outputs": list(plan.outputs),
            **({"code": dict(plan.code)} if plan.code else {}),
            "measures": list(plan.measures),
            "columns": {name: meaning for name, (_, meaning) in meanings(plan).items()},
            "versions": versions(PACKAGES),
            "provenance": provenance(plan.file.path.parent),
            "sweep": plan.file.text,
            "run": plan.file.base.text,
            "run_path": plan.file.base.path.name,
        }
        with Ledger(folder).seal(folder / FACTS) as part:
            part.write_text(json.dumps(facts, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return read_facts(folder / FACTS)
    known = read_facts(folder / FACTS)
    if known.fingerprint != plan.fingerprint:
        raise SweepError(
            f"{folder}: holds another sweep ({known.name}, of another sweep file, run file, model or code); choose "
            "another --out"
        )
    before, now = known.versions, versions(PACKAGES)
    other = [f"{name} {before.get(name)} (now {now[name]})" for name in now if before.get(name) != now[name]]
    if other:
        raise SweepError(
            f"{folder}: was begun with {', '.join(other)}, and would not be of one piece; choose another --out"
        )
    if (known.points, known.chunk) != (len(plan), plan.chunk):
        raise SweepError(f"{folder}: its {FACTS} is not what this sweep wrote; choose another --out")
    return known


def _settle(folder: Path) -> None:
    """Flush the folder, so that a new file name is on the disk."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def statuses(folder: Path) -> Counter[str]:
    """Number of rows of each status, one file at a time.

    Raises:
        SweepError: as :func:`read_table`.
    """
    found: Counter[str] = Counter()
    facts = read_facts(folder / FACTS)
    ledger = Ledger(folder)
    for chunk, path in chunk_files(folder / POINTS, facts).items():
        table = read_chunk(path, facts.rows(chunk), facts, ["point", "status"], ledger=ledger)
        found.update(table["status"].to_pylist())
    return found
