"""Whole files: there when complete, gone when not, and two writers do not meet."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from icmj.base import files


def test_a_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with files.whole(target) as part:
        part.write_text("half")
        assert not target.exists()
        assert part.name.endswith(files.SUFFIX)
    assert target.read_text() == "half"
    assert list(tmp_path.iterdir()) == [target]


def test_what_fails_leaves_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    files.write_text(target, "ζ before")
    with pytest.raises(TypeError), files.whole(target) as part:
        part.write_text(None)  # type: ignore[arg-type]
    assert target.read_text(encoding="utf-8") == "ζ before"
    assert list(tmp_path.iterdir()) == [target]


def test_two_writers_of_one_name_do_not_meet(tmp_path: Path) -> None:
    target = tmp_path / "a.bin"
    with files.whole(target) as first:
        first.write_bytes(b"first")
        files.write_bytes(target, b"second")
    assert target.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="none"):
        files.write_text(tmp_path / "none" / "a.txt", "")


def test_a_scratch_folder_goes_with_its_block(tmp_path: Path) -> None:
    with files.make_scratch(tmp_path / "report.html") as folder:
        (folder / "a.svg").write_text("a")
    with pytest.raises(FileExistsError), files.make_scratch(tmp_path / "report.html") as folder:
        folder.mkdir()
    assert list(tmp_path.iterdir()) == []


LEAVE = """
import os, sys
from pathlib import Path
from icmj.base.files import make_scratch, whole
target = Path(sys.argv[1])
with whole(target / "a.rrd") as part, make_scratch(target / "report.html") as folder:
    part.write_text("half")
    (folder / "b.svg").write_text("b")
    os._exit(9)
"""


def test_what_the_dead_left_is_cleared_and_the_living_keep_theirs(tmp_path: Path) -> None:
    (tmp_path / ".hidden.tmp").write_text("somebody else's")
    subprocess.run([sys.executable, "-c", LEAVE, tmp_path], check=False)
    assert len(list(tmp_path.iterdir())) == 3
    with files.whole(tmp_path / "b.txt") as part:
        part.write_text("mine")
        files.clear_leftovers(tmp_path)
        assert {path.name for path in tmp_path.iterdir()} == {".hidden.tmp", part.name}
    files.clear_leftovers(tmp_path / "nowhere")


def test_of_other_machines_only_what_is_old_goes(tmp_path: Path) -> None:
    young, old = (tmp_path / f".a.{place}-1-00000000.tmp" for place in ("000000", "000001"))
    for path in (young, old):
        path.write_text("theirs")
    os.utime(old, (1e9, 1e9))
    files.clear_leftovers(tmp_path)
    assert list(tmp_path.iterdir()) == [young]


def test_a_process_that_ended_is_not_alive() -> None:
    assert files.is_alive(os.getpid())
    child = subprocess.Popen([sys.executable, "-c", ""])
    while files.is_alive(child.pid):  # also while nobody has waited for it
        pass
    child.wait()
    assert not files.is_alive(child.pid)


def test_a_folder_is_ready_if_it_can_be_written_to(tmp_path: Path) -> None:
    files.make_ready(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        files.make_ready(tmp_path / "file")


@pytest.mark.parametrize(("make", "what"), [
    (os.mkfifo, "pipe"),
    (Path.mkdir, "folder"),
    (lambda path: path.symlink_to("/dev/zero"), "device"),
    (lambda path: path.symlink_to("/dev/tty"), "device"),
])  # fmt: skip
def test_only_regular_files_are_read_and_nothing_is_waited_for(make, what: str, tmp_path: Path) -> None:
    make(tmp_path / "a")
    for read in (files.open_file, files.read_bytes):
        with pytest.raises(OSError, match=f"a is a {what}, not a file"):
            read(tmp_path / "a", 1e9)


@pytest.mark.parametrize("name", ["a\0b", "\udcff\ud800", "x" * 400])
def test_what_is_no_name_of_a_file_is_an_error_of_the_system(name: str, tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"not a name of a file|File name too long"):
        files.read_bytes(tmp_path / name, 10)


def test_a_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    path, content = tmp_path / "a", os.urandom(3_000_000)
    path.write_bytes(content)
    assert files.read_bytes(path, 3_000_000) == content
    with files.open_file(path, 3e6) as file:
        assert (file.read(10), file.seek(-7, os.SEEK_END), file.read()) == (content[:10], 2_999_993, content[-7:])
        assert file.seek(0) == 0
        assert file.read() == content
    with pytest.raises(OSError, match=r"has 3 MB or more; expected at most 2\.9 MB"):
        files.read_bytes(path, 2_900_000)
    with open(path, "r+b") as file:  # a hole of a terabyte takes no room on the disk
        file.truncate(10**12)
    with pytest.raises(OSError, match=r"has 1e\+06 MB or more"):
        files.open_file(path, 1e9)


def test_a_file_that_grows_or_understates_its_size_ends_at_the_bound(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"1" * 10)
    with files.open_file(path, 100) as file:
        path.write_bytes(b"1" * 1000)
        with pytest.raises(OSError, match="expected at most"):
            file.read()
    endless = Path("/proc/self/pagemap")  # a regular file of no bytes, and of half a terabyte when it is read
    if endless.exists():
        assert endless.stat().st_size == 0
        with pytest.raises(OSError, match="expected at most 5 MB"):
            files.read_bytes(endless, 5e6)
