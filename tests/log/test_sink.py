"""What rerun writes into memory reaches the disk whole, or not at all and with a message."""

import os
from pathlib import Path

import pytest

from icmj.log.target import write_in_memory

linux = pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="no files in memory here")


@linux
def test_it_is_not_on_disk_before_it_is_whole(tmp_path: Path) -> None:
    part, content = tmp_path / "a", os.urandom(5_000_000)
    with write_in_memory(part) as sink:
        sink.write_bytes(content)
        assert list(tmp_path.iterdir()) == []
    assert part.read_bytes() == content


@linux
def test_what_fails_leaves_no_file(tmp_path: Path) -> None:
    open_before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(ValueError, match="why"), write_in_memory(tmp_path / "a") as sink:  # noqa: PT012
        sink.write_bytes(b"half")
        raise ValueError("why")
    with write_in_memory(tmp_path / "a"):
        pass
    assert list(tmp_path.iterdir()) == []
    assert len(os.listdir("/proc/self/fd")) == open_before


@linux
def test_a_full_disk_is_an_error_at_once() -> None:
    with pytest.raises(OSError, match="No space left"), write_in_memory(Path("/dev/full")) as sink:
        sink.write_bytes(b"0" * 10_000_000)


def test_without_files_in_memory_it_is_the_file_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("icmj.log.target._OPEN", tmp_path / "nowhere")
    with write_in_memory(tmp_path / "a") as sink:
        assert sink == tmp_path / "a"
