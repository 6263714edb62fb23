"""A branch read back is the branch that was written, to the last bit."""

import os
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from cycle_cases import branch

from icmj.cycle.branch import read_branch, write_branch
from icmj.errors import LogError


def same(a: object, b: object) -> None:
    """Equal in every field, arrays to the bit."""
    for field in fields(a):  # type: ignore[arg-type]
        mine, theirs = getattr(a, field.name), getattr(b, field.name)
        if isinstance(mine, np.ndarray):
            assert mine.dtype == theirs.dtype
            np.testing.assert_array_equal(mine, theirs)
        elif field.name == "specials":
            assert len(mine) == len(theirs)
            for one, other in zip(mine, theirs, strict=True):
                same(one, other)
        elif field.name == "run":
            assert mine.text == theirs.text
            assert mine.path == theirs.path
        elif isinstance(mine, complex):
            np.testing.assert_equal(mine, theirs)
        else:
            assert mine == theirs


def test_parquet_keeps_every_bit(tmp_path: Path) -> None:
    kept = branch("simple-1.7", "b", 1.5, plant="linear", points=8)
    assert kept.specials
    write_branch(kept, tmp_path / "b.parquet")
    same(kept, read_branch(tmp_path / "b.parquet"))
    assert [path.name for path in tmp_path.iterdir()] == ["b.parquet"]


def test_changed_values_are_kept(tmp_path: Path) -> None:
    kept = branch("simple-1.7", "b", 1.5, plant="linear", points=8)
    changed = replace(kept, run=kept.run.with_(**{"controller.q_t": 0.02}))
    write_branch(changed, tmp_path / "b.parquet")
    found = read_branch(tmp_path / "b.parquet").run
    assert dict(found.changes) == {**kept.run.changes, "controller.q_t": "0.02"}
    assert found.title.endswith("(changed)")


def test_what_is_no_branch_is_refused_in_a_line(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    with pytest.raises(LogError, match=r"none\.parquet"):
        read_branch(tmp_path / "none.parquet")
    parquet.write_table(pa.table({"value": [1.0]}), tmp_path / "other.parquet")
    with pytest.raises(LogError, match="not a branch"):
        read_branch(tmp_path / "other.parquet")
    (tmp_path / "text.parquet").write_text("no")
    with pytest.raises(LogError, match="not a branch"):
        read_branch(tmp_path / "text.parquet")


def test_a_pipe_for_a_branch_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.parquet")
    with pytest.raises(LogError, match=r"pipe\.parquet is a pipe, not a file"):
        read_branch(tmp_path / "pipe.parquet")
