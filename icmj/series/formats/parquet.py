"""Parquet: a column for each signal, with its unit in the metadata of the field, and facts in those of the schema."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from icmj.base.array import Array
from icmj.base.parquet import refuse_fatal
from icmj.base.text import one_line
from icmj.errors import DataError
from icmj.series.columns import choose_columns
from icmj.series.long_table import find_labels
from icmj.series.series import SETTLED, Series

if TYPE_CHECKING:
    import pyarrow as pa

SUFFIXES = (".parquet",)
BUFFER = 8_000_000  # bytes
ROWS = 100_000  # read at a time
_INDEX = re.compile(r"__index_level_\d+__")  # an index without a name, as pandas writes it


def read(path: Path, source: BinaryIO, columns: Sequence[str], rate: float | None) -> tuple[Series, ...]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        refuse_fatal(path)
        with pq.ParquetFile(source, pre_buffer=False, buffer_size=BUFFER) as file:
            every = list(file.schema_arrow)
            settled = f"icmj.{SETTLED}".encode() in (file.schema_arrow.metadata or {})
            labels = find_labels([f.name for f in every], columns)
            indexes = [
                i
                for i, f in enumerate(every)
                if _INDEX.fullmatch(f.name) and pa.types.is_integer(f.type) and f.name not in columns
            ]
            good = [i for i, f in enumerate(every) if _holds_numbers(f.type) and i not in (*labels, *indexes)]
            good.sort(key=lambda i: not pa.types.is_temporal(every[i].type))  # of the times, whatever they are called
            left = [
                f"{f.name}, which is of type {f.type}"
                for i, f in enumerate(every)
                if i not in (*good, *labels, *indexes)
            ] + [f"{every[i].name}, which counts rows in pandas" for i in indexes]
            fields = [every[i] for i in good]
            if not fields:
                raise DataError("no column of numbers")
            units = [(f.metadata or {}).get(b"unit", b"").decode(errors="replace") for f in fields]
            units = ["s" if pa.types.is_temporal(f.type) else unit for f, unit in zip(fields, units, strict=True)]
            choice = choose_columns([f.name for f in fields], units, columns, rate, left)
            names = [f.name for f in every]  # two may have one name
            texts = [i for i, f in enumerate(every) if i in labels or (_holds_text(f.type) and not columns)]
            chosen = [(names[i], names[:i].count(names[i])) for i in (*(good[i] for i in choice.at), *texts)]
            data, count, cells = choice.room(file.metadata.num_rows), 0, [list[pa.Array]() for _ in texts]
            for batch in file.iter_batches(ROWS, columns=list({name for name, _ in chosen}), use_threads=False):
                found = [batch.column(batch.schema.get_all_field_indices(name)[which]) for name, which in chosen]
                for i, column in enumerate(found[: len(choice.at)]):
                    data[count : count + len(batch), i] = _to_numbers(column)
                for known, column in zip(cells, found[len(choice.at) :], strict=True):
                    known.append(column.cast(pa.string()))
                count += len(batch)
            told = [(names[i], pa.chunked_array(known, pa.string())) for i, known in zip(texts, cells, strict=True)]
    except (pa.ArrowException, OSError, IndexError, ValueError) as error:
        raise DataError(f"not a Parquet file that can be read ({one_line(error, 160)})") from error
    trials = choice.to_trials(data[:count], told)
    return tuple(replace(one, facts={**one.facts, SETTLED: ""}) for one in trials) if settled else trials


def _holds_numbers(kind: pa.DataType) -> bool:
    import pyarrow.types as kinds

    return bool(
        kinds.is_floating(kind) or kinds.is_integer(kind) or kinds.is_decimal(kind) or kinds.is_timestamp(kind)
        or kinds.is_duration(kind)
    )  # fmt: skip


def _holds_text(kind: pa.DataType) -> bool:
    import pyarrow.types as kinds

    kind = kind.value_type if kinds.is_dictionary(kind) else kind
    return bool(kinds.is_string(kind) or kinds.is_large_string(kind))


def _to_numbers(column: pa.Array) -> Array:
    """Numbers; of times and durations those of seconds."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        return _to_numbers(column.cast(pa.int64())) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
    if pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=float)


def write(series: Series, part: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [
        pa.field(name, pa.float64(), metadata={"unit": unit})
        for name, unit in zip(("t", *series.names), ("s", *series.units), strict=True)
    ]
    schema = pa.schema(fields, metadata={f"icmj.{key}": value for key, value in series.facts.items()})
    pq.write_table(pa.table([pa.array(column) for column in (series.t, *series.values.T)], schema=schema), part)
