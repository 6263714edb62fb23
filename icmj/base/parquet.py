"""Tables from untrusted Parquet files: within bounds, with one kind of error.

A few kilobytes may stand for gigabytes: repeated values take no room in a file. What a file says of its sizes is
checked before anything is read, and what is read is counted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from icmj.base.text import one_line

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

_WIDEST = 8  # bytes of a number
_TEXT = "BYTE_ARRAY"


def read_parquet(
    content: bytes,
    most_rows: int,
    most_bytes: float,
    columns: Sequence[str] | None = None,
    check: Callable[[pa.Schema, int], None] | None = None,
) -> pa.Table:
    """The table in the content of a Parquet file.

    Args:
        content: of the file.
        most_rows, most_bytes: of the table.
        columns: those to read; all if ``None``.
        check: called with the schema and the number of rows before any is read; raises ValueError.

    Raises:
        ValueError: in one line, if it is none, or larger.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(pa.BufferReader(content)) as file:
            at_once = _rows_at_once(file.metadata, most_rows, most_bytes)
            if check is not None:
                check(file.schema_arrow, file.metadata.num_rows)
            batches, size = [], 0
            for batch in file.iter_batches(at_once, columns=columns, use_threads=False):
                size += batch.nbytes
                if size > most_bytes:
                    raise ValueError(_too_large(size, most_bytes))
                batches.append(batch)
            schema = file.schema_arrow if columns is None else pa.schema(map(file.schema_arrow.field, columns))
            return pa.Table.from_batches(batches, batches[0].schema if batches else schema)
    except Exception as error:  # arrow raises a dozen types on damaged files, among them one for want of memory
        raise ValueError(one_line(error, 160)) from error


def _rows_at_once(found: pq.FileMetaData, most_rows: int, most_bytes: float) -> int:
    """How many rows may be read together, if it is not too large by what it says of itself.

    Raises:
        ValueError: if it is.
    """
    if found.num_rows > most_rows:
        raise ValueError(f"{found.num_rows} rows; expected at most {most_rows}")
    size, longest = 0, 1
    for group in map(found.row_group, range(found.num_row_groups)):
        for column in map(group.column, range(group.num_columns)):
            size += max(column.total_uncompressed_size, _WIDEST * column.num_values)
            if column.physical_type == _TEXT:  # each row may be as long as all of them are in the file
                longest = max(longest, column.total_uncompressed_size)
    if size > most_bytes:
        raise ValueError(_too_large(size, most_bytes))
    return max(1, min(1 << 16, int(most_bytes / (4 * longest))))


def _too_large(size: float, most: float) -> str:
    return f"{size / 1e6:.0f} MB of data; expected at most {most / 1e6:g} MB"
