"""Whole files: there when complete, gone when not, and two writers do not meet."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from icmj.base.files import SUFFIX, alive, clear_leftovers, ready, scratch, whole, write_bytes, write_text


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


def test_a_scratch_folder_goes_with_its_block(tmp_path: Path) -> None:
    with scratch(tmp_path / "report.html") as folder:
        (folder / "a.svg").write_text("a")
    with pytest.raises(FileExistsError), scratch(tmp_path / "report.html") as folder:
        folder.mkdir()
    assert list(tmp_path.iterdir()) == []


LEAVE = """
import os, sys
from pathlib import Path
from icmj.base.files import scratch, whole
target = Path(sys.argv[1])
with whole(target / "a.rrd") as part, scratch(target / "report.html") as folder:
    part.write_text("half")
    (folder / "b.svg").write_text("b")
    os._exit(9)
"""


def test_what_the_dead_left_is_cleared_and_the_living_keep_theirs(tmp_path: Path) -> None:
    (tmp_path / ".hidden.tmp").write_text("somebody else's")
    subprocess.run([sys.executable, "-c", LEAVE, tmp_path], check=False)
    assert len(list(tmp_path.iterdir())) == 3
    with whole(tmp_path / "b.txt") as part:
        part.write_text("mine")
        clear_leftovers(tmp_path)
        assert {path.name for path in tmp_path.iterdir()} == {".hidden.tmp", part.name}
    clear_leftovers(tmp_path / "nowhere")


def test_of_other_machines_only_what_is_old_goes(tmp_path: Path) -> None:
    young, old = (tmp_path / f".a.{place}-1-00000000.tmp" for place in ("000000", "000001"))
    for path in (young, old):
        path.write_text("theirs")
    os.utime(old, (1e9, 1e9))
    clear_leftovers(tmp_path)
    assert list(tmp_path.iterdir()) == [young]


def test_a_process_that_ended_is_not_alive() -> None:
    assert alive(os.getpid())
    child = subprocess.Popen([sys.executable, "-c", ""])
    while alive(child.pid):  # also while nobody has waited for it
        pass
    child.wait()
    assert not alive(child.pid)


def test_a_folder_is_ready_if_it_can_be_written_to(tmp_path: Path) -> None:
    ready(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        ready(tmp_path / "file")
