"""The folder of a sweep: one Parquet file a chunk, written whole; what it is of; a lock while somebody writes.

    OUT/sweep.json          what it is of: texts, fingerprint, versions, provenance
    OUT/points/*.parquet    the rows, a chunk a file; what stands there is done
    OUT/timing.csv          how long each chunk took

Rows and files hold no time and no place, so that they are the same bit for bit whoever computed them, and when.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.files import clear_leftovers, ready, whole, write_text
from icmj.errors import SweepError
from icmj.result.swept import Swept
from icmj.sweeps.chunk import Computed
from icmj.sweeps.columns import meanings
from icmj.sweeps.plan import Plan, versions
from icmj.work.provenance import provenance

FACTS, POINTS, TIMING, LOCK = "sweep.json", "points", "timing.csv", ".lock"


class Dataset:
    """The folder of one sweep, open for writing; see :func:`opened`."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        self.folder, self._plan = folder, plan

    def finished(self) -> set[int]:
        """Chunks that are done."""
        return {int(path.stem) for path in (self.folder / POINTS).glob("*.parquet") if path.stem.isdecimal()}

    def write(self, chunk: int, content: bytes) -> None:
        """Put one chunk in its place; it is on the disk before it has its name.

        Raises:
            SweepError: if it cannot be written.
        """
        target = self.folder / POINTS / f"{chunk:08d}.parquet"
        try:
            with whole(target) as part, part.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            _settle(target.parent)
        except OSError as error:
            raise SweepError(f"{target}: cannot be written: {error.strerror}; what is finished is kept") from error

    def time(self, chunk: int, computed: Computed) -> None:
        """Note how long a chunk took; of no weight, and lost where it cannot be written."""
        with suppress(OSError), (self.folder / TIMING).open("a", encoding="utf-8") as file:
            file.write(f"{chunk},{computed.rows},{computed.failed},{computed.seconds:.4f},{computed.simulating:.4f}\n")


@contextmanager
def opened(folder: Path, plan: Plan) -> Iterator[Dataset]:
    """The folder of a sweep, begun or taken up again; nobody else writes to it within the block.

    Raises:
        SweepError: if another process is at it, or it holds another sweep, or one of other versions, or cannot be
            written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _locked(folder):
            ready(folder)
            _begin(folder, plan)
            (folder / POINTS).mkdir(exist_ok=True)
            clear_leftovers(folder / POINTS)
            yield Dataset(folder, plan)
    except OSError as error:
        raise SweepError(f"{folder}: cannot be written to: {error.strerror}; choose another --out") from error


def facts_of(folder: Path) -> Mapping[str, Any]:
    """What a folder says that it is of.

    Raises:
        SweepError: if it is not the folder of a sweep.
    """
    try:
        found = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        if not isinstance(found, dict) or "fingerprint" not in found:
            raise ValueError
    except (OSError, ValueError) as error:
        raise SweepError(f"{folder}: not the folder of a sweep; it has no sound {FACTS}") from error
    return found


def read_sweep(folder: Path | str) -> Swept:
    """A sweep as far as it is finished, with what its pictures need.

    Raises:
        SweepError: if the folder is not that of a sweep, or nothing is finished there.
    """
    folder = Path(folder)
    facts = facts_of(folder)
    varies = tuple(zip(facts["varies"], facts["fields"], strict=True))
    return Swept(facts["name"], facts["title"] or facts["name"], varies, facts["points"], read_table(folder))


def read_table(folder: Path) -> pa.Table:
    """All rows of a folder that are there, in order, as one table.

    Raises:
        SweepError: if there is none, or a file of it cannot be read.
    """
    files = sorted((folder / POINTS).glob("*.parquet"))
    if not files:
        raise SweepError(f"{folder}: no point is finished there")
    try:
        return pa.concat_tables([pq.read_table(file) for file in files])
    except (OSError, pa.ArrowException) as error:
        raise SweepError(f"{folder}: cannot be read: {error}") from error


def _begin(folder: Path, plan: Plan) -> None:
    """Say what the folder is of, or see that it is of this."""
    if not (folder / FACTS).exists():
        if (folder / POINTS).exists():
            raise SweepError(f"{folder}: has points but no {FACTS} that says of what; choose another --out")
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
            "columns": {name: meaning for name, (_, meaning) in meanings(plan).items()},
            "versions": versions(),
            "provenance": provenance(plan.file.path.parent),
            "sweep": plan.file.text,
            "run": plan.file.base.text,
            "run_path": plan.file.base.path.name,
        }
        write_text(folder / FACTS, json.dumps(facts, indent=1, ensure_ascii=False) + "\n")
        return
    known = facts_of(folder)
    if known["fingerprint"] != plan.fingerprint:
        raise SweepError(
            f"{folder}: holds another sweep ({known.get('name')}, of another sweep file, run file or model); choose "
            "another --out"
        )
    before, now = known.get("versions", {}), versions()
    other = [f"{name} {before.get(name)} (now {now[name]})" for name in now if before.get(name) != now[name]]
    if other:
        raise SweepError(
            f"{folder}: was begun with {', '.join(other)}, and would not be of one piece; choose another --out"
        )


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Nobody else at the folder; the lock goes with the process, however that ends."""
    import fcntl

    with (folder / LOCK).open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            who = file.read().strip()
            whose = f" (process {who})" if who.isdecimal() else ""
            raise SweepError(
                f"{folder}: another sweep{whose} is writing there; wait for it, or choose another --out"
            ) from None
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        yield


def _settle(folder: Path) -> None:
    """See that a new name is on the disk, too."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def statuses(folder: Path) -> Counter[str]:
    """How many rows have which status, a file at a time."""
    found: Counter[str] = Counter()
    for file in sorted((folder / POINTS).glob("*.parquet")):
        found.update(pq.read_table(file, columns=["status"])["status"].to_pylist())
    return found
