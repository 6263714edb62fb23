"""A branch in a Parquet file: one row for each cycle, all other data in the metadata, restored bit for bit."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base.array import Array
from icmj.base.files import regular, whole
from icmj.base.text import one_line
from icmj.cycle.branch import KINDS, Branch, SpecialPoint
from icmj.errors import IcmjError, LogError
from icmj.runfile.reading import parse_run

FORMAT = 1
_KEY = b"icmj branch"
COLUMNS = (
    *("value", "intervals", "states", "y_peak", "y_range", "multipliers", "closure", "graze"),
    *("t", "x", "y", "u", "qpos"),
)
_LISTED = ("scale",)


def write_branch(branch: Branch, path: Path | str) -> None:
    """Write a branch as Parquet; the file is either complete or absent.

    Each column contains a list of numbers for each cycle, in row-major order; the shapes are in the metadata.
    ``multipliers`` are pairs (re, im).

    Raises:
        LogError: if the file cannot be written.
    """
    import pyarrow as pa
    from pyarrow import parquet

    path = Path(path)
    head, flat = packed(branch)
    columns = {}
    for name, values in flat.items():
        width = values.size // len(branch)
        ends = np.arange(len(branch) + 1, dtype=np.int64) * width
        one = getattr(branch, name).ndim == 1
        columns[name] = pa.array(values) if one else pa.LargeListArray.from_arrays(pa.array(ends), pa.array(values))
    table = pa.table(columns).replace_schema_metadata({_KEY: head.encode()})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as part:
            parquet.write_table(table, part)
    except (OSError, pa.ArrowException) as error:
        raise LogError(f"{path}: the branch cannot be written ({one_line(error, 200)})") from error


def read_branch(path: Path | str) -> Branch:
    """Read a branch that :func:`write_branch` wrote.

    Raises:
        LogError: if the file does not exist, or is not a branch of this version.
    """
    import pyarrow as pa
    from pyarrow import parquet

    path = Path(path)
    try:
        with os.fdopen(regular(path, os.O_RDONLY), "rb") as file:
            table = parquet.read_table(file)
        flat = {}
        for name in COLUMNS:
            column = table.column(name).combine_chunks()
            values = column.flatten() if isinstance(column, pa.LargeListArray) else column
            flat[name] = values.to_numpy(zero_copy_only=False)
        return unpacked(table.schema.metadata[_KEY].decode(), flat)
    except IcmjError as error:
        raise LogError(f"{path}: {error}") from error
    except (OSError, pa.ArrowException, LookupError, TypeError, ValueError) as error:
        raise LogError(f"{path}: not a branch that icmj wrote ({one_line(error, 200)})") from error


def branches_among(paths: Sequence[Path]) -> tuple[list[Branch], list[Path]]:
    """The branches that Parquet files among some paths hold, and the other paths.

    Raises:
        LogError: if a Parquet file is no branch.
    """
    parquet = [path for path in paths if path.suffix == ".parquet"]
    return [read_branch(path) for path in parquet], [path for path in paths if path not in parquet]


def packed(branch: Branch) -> tuple[str, dict[str, Array]]:
    """A branch as JSON text and flat arrays of numbers by name."""
    shapes, flat = {}, {}
    for name in COLUMNS:
        values = getattr(branch, name)
        if np.iscomplexobj(values):
            values = np.stack([values.real, values.imag], axis=-1)
        shapes[name] = list(values.shape[1:])
        flat[name] = np.ascontiguousarray(values, dtype=float).ravel()
    return json.dumps(_head(branch, shapes)), flat


def unpacked(text: str, flat: Mapping[str, Array]) -> Branch:
    """The branch from what :func:`packed` gave.

    Raises:
        LogError: if it is of another version.
        LookupError, TypeError, ValueError: if it is none.
    """
    head = json.loads(text)
    if head["format"] != FORMAT:
        raise LogError(f"a branch of format {head['format']}; this version reads {FORMAT}")
    parts: dict[str, Any] = {}
    for name in COLUMNS:
        parts[name] = np.array(flat[name], dtype=float).reshape([len(flat["value"]), *head["shapes"][name]])
    parts["multipliers"] = parts["multipliers"][..., 0] + 1j * parts["multipliers"][..., 1]
    return _branch(head, parts)


def _head(branch: Branch, shapes: dict[str, list[int]]) -> dict[str, Any]:
    rest = {f.name: getattr(branch, f.name) for f in fields(branch) if f.name not in (*COLUMNS, "run", "specials")}
    return {
        **{name: value.tolist() if name in _LISTED else value for name, value in rest.items()},
        "format": FORMAT,
        "shapes": shapes,
        "run": {"text": branch.run.text, "path": branch.run.path.as_posix()},
        "specials": [
            {
                **{name: getattr(s, name) for name in ("kind", "value", "index", "words")},
                "state": s.state.tolist(),
                "intervals": s.intervals.tolist(),
                "y_peak": s.y_peak.tolist(),
                "multiplier": [s.multiplier.real, s.multiplier.imag],
            }
            for s in branch.specials
        ],
    }


def _branch(head: dict[str, Any], parts: dict[str, Any]) -> Branch:
    specials = []
    for s in head["specials"]:
        if s["kind"] not in KINDS:
            raise ValueError(f"a special point of kind {s['kind']!r}")
        arrays = {name: np.array(s[name], dtype=float) for name in ("state", "intervals", "y_peak")}
        specials.append(SpecialPoint(**{**s, **arrays, "multiplier": complex(*s["multiplier"])}))
    rest: dict[str, Any] = {name: head[name] for name in ("parameter", "plant", "mirrored", "neutral", "end")}
    names: dict[str, Any] = {name: tuple(head[name]) for name in ("outputs", "inputs", "names", "units")}
    run = parse_run(head["run"]["text"], head["run"]["path"])
    return Branch(
        run=run, **rest, **names, **parts, scale=np.array(head["scale"], dtype=float), specials=tuple(specials)
    )
