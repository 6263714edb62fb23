"""Validation of a sweep's folder, which may come from others or be damaged."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from icmj.base.ledger import Ledger
from icmj.base.parquet import read_parquet
from icmj.base.text import one_line
from icmj.errors import SweepError
from icmj.runfile.sweep_tables import Facts, parse_facts
from icmj.sweeps.columns import TYPES, columns

MOST_BYTES = 50_000_000  # of what a folder says that it is of
MOST_OF_CHUNK = 500e6  # bytes of one chunk, in its file and in memory
_CHUNK = re.compile(r"\d{8,10}")


def read_facts(path: Path) -> Facts:
    """The facts in a file.

    Raises:
        SweepError: if it is not there, or no such file.
    """
    try:
        return parse_facts(Ledger(path.parent).read(path, MOST_BYTES))
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    raise SweepError(f"{path.parent}: not the folder of a sweep; it has no sound {path.name} ({one_line(why, 160)})")


def chunk_files(folder: Path, facts: Facts) -> dict[int, Path]:
    """The files of finished chunks by their number, in order.

    Raises:
        SweepError: if one has a name that none of them has.
    """
    found = {}
    for path in folder.glob("*.parquet"):
        number = int(path.stem) if _CHUNK.fullmatch(path.stem) and path.stem.isascii() else -1
        if f"{number:08d}" != path.stem or number >= facts.chunks:
            raise SweepError(f"{one_line(path, 300)}: not a chunk of this sweep, by its name; remove it")
        found[number] = path
    return dict(sorted(found.items()))


def read_chunk(
    path: Path,
    rows: range,
    facts: Facts,
    only: Sequence[str] = (),
    schema: pa.Schema | None = None,
    ledger: Ledger | None = None,
) -> pa.Table:
    """The rows of one chunk.

    Args:
        path: its file.
        rows: the points that it is of.
        facts: of the folder.
        only: columns to read; all if there are none.
        schema: what its columns must be; any that a sweep of these facts may have, if ``None``.
        ledger: of the folder, so that it is read once for several chunks.

    Raises:
        SweepError: if it is not a file of these points.
    """

    def check(found: pa.Schema, count: int) -> None:
        _check_columns(found, facts, schema)
        if count != len(rows):
            raise ValueError(f"{count} rows, expected {len(rows)}")

    try:
        content = (ledger or Ledger(path.parent.parent)).read(path, MOST_OF_CHUNK)
        table = read_parquet(content, facts.chunk, MOST_OF_CHUNK, list(only) or None, check)
        _check_values(table, rows, facts)
        return table
    except Exception as error:  # of arrow's, a dozen types on damaged files
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise SweepError(
            f"{path}: not a chunk of this sweep ({one_line(reason, 160)}); remove it, and it is computed again"
        ) from error


def _check_columns(found: pa.Schema, facts: Facts, schema: pa.Schema | None) -> None:
    if (found.metadata or {}).get(b"icmj.fingerprint") != facts.fingerprint.encode():
        raise ValueError("of another sweep")
    if schema is not None:
        if not found.equals(schema):
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
        predicted="root_real" not in names, measures=facts.measures,
    )  # fmt: skip
    if names != list(expected):
        raise ValueError("columns that a sweep does not have, or lacks")
    for field in found:
        types = TYPES.values() if field.name in facts.varies else [expected[field.name][0]]
        if field.type not in types:
            raise ValueError(f"column {field.name} of {field.type}")


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
