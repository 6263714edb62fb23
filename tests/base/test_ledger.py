"""Digests beside files: what was written is believed, anything else is not, whenever the writer died."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from icmj.base.ledger import SUMS, Ledger


def sealed(path: Path, content: bytes) -> None:
    with Ledger(path.parent).seal(path) as part:
        part.write_bytes(content)


def test_what_was_sealed_is_read_and_every_bit_counts(tmp_path: Path) -> None:
    path, content = tmp_path / "a.bin", os.urandom(40)
    sealed(path, content)
    assert Ledger(tmp_path).read(path, 100) == content
    for bit in range(8 * len(content)):
        path.write_bytes(bytes(byte ^ (1 << bit % 8 if i == bit // 8 else 0) for i, byte in enumerate(content)))
        with pytest.raises(OSError, match=r"a\.bin is not as it was written: its SHA-256 is not in SHA256SUMS"):
            Ledger(tmp_path).read(path, 100)
    path.write_bytes(content)
    (tmp_path / SUMS).unlink()
    with pytest.raises(OSError, match="not as it was written"):
        Ledger(tmp_path).read(path, 100)


def test_another_program_checks_the_digests(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    ledger = Ledger(tmp_path)
    for name in ("a", "inner/b"):
        with ledger.seal(tmp_path / name) as part:
            part.write_text(name)
    done = subprocess.run(["sha256sum", "-c", SUMS], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "a: OK\ninner/b: OK\n")


def test_a_file_that_has_the_name_of_another_is_not_it(tmp_path: Path) -> None:
    sealed(tmp_path / "a", b"one")
    sealed(tmp_path / "b", b"two")
    (tmp_path / "b").write_bytes(b"one")
    with pytest.raises(OSError, match="b is not as it was written"):
        Ledger(tmp_path).read(tmp_path / "b", 10)


@pytest.mark.parametrize("last", ["rename", "line"])
def test_whoever_dies_in_between_leaves_a_file_that_is_new_or_as_before(
    last: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a"
    sealed(path, b"before")

    def die(*_: object) -> None:
        raise SystemExit

    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", die) if last == "rename" else patched.setattr(os, "fsync", die)
        with pytest.raises(SystemExit):
            sealed(path, b"after")
    assert Ledger(tmp_path).read(path, 10) == b"before"
    sealed(path, b"after")
    assert Ledger(tmp_path).read(path, 10) == b"after"


def test_a_line_that_was_left_unfinished_spoils_no_other(tmp_path: Path) -> None:
    sealed(tmp_path / "a", b"one")
    with (tmp_path / SUMS).open("a") as file:
        file.write("0123")
    sealed(tmp_path / "b", b"two")
    assert [Ledger(tmp_path).read(tmp_path / name, 10) for name in "ab"] == [b"one", b"two"]


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_digests_that_are_no_file_are_refused(make, tmp_path: Path) -> None:
    sealed(tmp_path / "a", b"one")
    (tmp_path / SUMS).unlink()
    make(tmp_path / SUMS)
    with pytest.raises(OSError, match=r"not a file|is a pipe"):
        Ledger(tmp_path).read(tmp_path / "a", 10)
    with pytest.raises(OSError, match=r"not replaced|not a file|is there"):
        sealed(tmp_path / "b", b"two")
    assert not (tmp_path / "b").exists()
