"""Parquet files that stand for more than they hold: refused before it is there, in one line."""

import io
import tracemalloc

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from icmj.base.parquet import read_parquet


def content(table: pa.Table) -> bytes:
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def lists(n: int) -> pa.Table:
    return pa.table({"a": pa.ListArray.from_arrays(pa.array([0, n], pa.int32()), pa.array(np.zeros(n)))})


def many_rows() -> pa.Table:
    return pa.table({"a": np.zeros(5_000_000)})


BOMBS = {
    "rows": (many_rows, "5000000 rows; expected at most 1000000"),
    "one long row": (lambda: lists(5_000_000), "40 MB of data; expected at most 10 MB"),
    "text": (
        lambda: pa.table({"a": pa.array(["x" * 10**6]).take(pa.array(np.zeros(1000, int)))}),
        "MB of data; expected",
    ),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_few_kilobytes_do_not_become_gigabytes(name: str) -> None:
    table, words = BOMBS[name]
    packed = content(table())
    assert len(packed) < 1e5
    before = pa.total_allocated_bytes()
    tracemalloc.start()
    with pytest.raises(ValueError, match=words) as caught:
        read_parquet(packed, 1_000_000, 1e7)
    assert "\n" not in str(caught.value)
    assert pa.total_allocated_bytes() - before < 2e7  # as much as is allowed, and a part that is more
    assert tracemalloc.get_traced_memory()[1] < 2e7
    tracemalloc.stop()


@pytest.mark.parametrize("many", [0, 1, 70_000])
def test_what_is_within_bounds_is_read_as_pyarrow_reads_it(many: int) -> None:
    table = pa.table({"a": np.arange(many, dtype=float), "b": pa.array(["ζ", None] * many, pa.string())[:many]})
    table = table.replace_schema_metadata({"who": "me"})
    packed = content(table)
    assert read_parquet(packed, 70_000, 1e7).equals(pq.read_table(pa.BufferReader(packed)), check_metadata=True)
    assert read_parquet(packed, 70_000, 1e7, ["b"]).column_names == ["b"]


@pytest.mark.parametrize("cut", [b"", b"PAR1", b"PAR1" + bytes(100) + b"PAR1", None])
def test_what_is_no_parquet_file_is_one_kind_of_error(cut: bytes | None) -> None:
    cut = content(many_rows())[:-30] if cut is None else cut  # a sound one, cut short
    with pytest.raises(ValueError, match=r".+") as caught:
        read_parquet(cut, 10, 1e6)
    assert "\n" not in str(caught.value)
