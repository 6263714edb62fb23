"""Tables from untrusted Parquet files: within bounds, with one kind of error.

A few kilobytes may stand for gigabytes: repeated values take no room in a file. What a file says of its sizes is
checked before anything is read, and what is read is counted. Some damaged files end the process that reads them, so
that another one tries them first.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.base.bounded_program import run_bounded
from icmj.base.text import one_line

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


_WIDEST = 8  # bytes of a number
_TEXT = "BYTE_ARRAY"
_AT_A_TIME = 1000  # files that one process tries
_LONGEST, _A_BYTE = 120.0, 5e-7  # s on the clock, and beside it for a byte
_ROOM, _ROOM_A_BYTE = 2 << 30, 8  # bytes of memory, and beside them for a byte
_TRY = """
import sys
import pyarrow.parquet as pq
for index, path in enumerate(sys.argv[1:]):
    sys.stderr.write(f"{index}\\n")
    try:
        with pq.ParquetFile(path, pre_buffer=False) as file:
            for _ in file.iter_batches(4096, use_threads=False):
                pass
    except Exception:
        pass
"""


def find_fatal(paths: Iterable[Path]) -> Path | None:
    """The first of some Parquet files that ends the process which reads it, or needs time or memory beyond its size.

    They are read in a process of their own, as a few flipped bits can abort the reader; that must not be this one.
    Others that cannot be read, :func:`read_parquet` refuses. Takes a third of a second for a thousand small files.
    """
    left = [path for path in paths if path.is_file()]
    while left:
        some, left = left[:_AT_A_TIME], left[_AT_A_TIME:]
        size = sum(path.stat().st_size for path in some)
        command = [sys.executable, "-P", "-c", _TRY, *(str(path.absolute()) for path in some)]
        try:
            done = run_bounded(command, _LONGEST + _A_BYTE * size, data=_ROOM + _ROOM_A_BYTE * size)
            said, ended = done.stderr, done.returncode != 0
        except subprocess.TimeoutExpired as error:
            said, ended = (error.stderr or b"").decode(errors="replace"), True
        reached = [line for line in said.splitlines() if line.isdecimal()]
        if ended and reached:
            return some[int(reached[-1])]
    return None


def refuse_fatal(path: Path) -> None:
    """See that a Parquet file can be read, or refused, by this process.

    Raises:
        ValueError: in one line, if it is of those that :func:`find_fatal` finds.
    """
    if find_fatal([path]) is not None:
        raise ValueError(FATAL)


FATAL = "damaged: reading it ends the process that reads it"


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
        with pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True) as file:
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
