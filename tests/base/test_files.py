"""Whole files: there when complete, gone when not, and two writers do not meet."""

from __future__ import annotations

from pathlib import Path

import pytest

from icmj.base.files import SUFFIX, whole, write_bytes, write_text


def test_a_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with whole(target) as part:
        part.write_text("half")
        assert not target.exists()
        assert part.name.endswith(SUFFIX)
    assert target.read_text() == "half"
    assert list(tmp_path.iterdir()) == [target]


def test_what_fails_leaves_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    write_text(target, "ζ before")
    with pytest.raises(TypeError), whole(target) as part:
        part.write_text(None)  # type: ignore[arg-type]
    assert target.read_text(encoding="utf-8") == "ζ before"
    assert list(tmp_path.iterdir()) == [target]


def test_two_writers_of_one_name_do_not_meet(tmp_path: Path) -> None:
    target = tmp_path / "a.bin"
    with whole(target) as first:
        first.write_bytes(b"first")
        write_bytes(target, b"second")
    assert target.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="none"):
        write_text(tmp_path / "none" / "a.txt", "")
