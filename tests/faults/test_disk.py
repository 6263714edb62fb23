"""No room, no right, no single writer: one line, and nothing under its name that is not whole."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_cases import check_folder, short_run, start
from patience import PATIENCE
from terminal_cases import told

from icmj.cli.main import main

pytestmark = pytest.mark.slow


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 256 kB."""
    mount = tmp_path / "disk"
    mount.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", mount], capture_output=True, check=False)
    if done.returncode:
        pytest.skip("no right to mount a small file system")
    yield mount
    subprocess.run(["umount", "-l", mount], check=False)


def refused(*arguments: str | Path) -> str:
    """The one line of a command that is refused."""
    process = start(*arguments)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    return the_line(err)


def the_line(err: str) -> str:
    (line,) = told(err)
    assert line.startswith("icmj: ")
    return line


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path, small_disk: Path) -> None:
    run = short_run(tmp_path, duration=100.0)
    assert "cannot be written" in refused("run", run, "--plant", "linear", "--out", small_disk)
    assert list(small_disk.iterdir()) == []
    refused("study", run, "--jobs", "2", "--out", small_disk)
    assert not [path for path in small_disk.iterdir() if path.name.startswith(".")]
    check_folder(small_disk)
    (small_disk / "fill").write_bytes(b"0" * (os.statvfs(small_disk).f_bavail * os.statvfs(small_disk).f_frsize))
    # before anything is simulated
    assert "cannot be written to (No space left" in refused("run", run, "--out", small_disk)
    assert "cannot be written to (No space left" in refused("study", run, "--out", small_disk)
    assert [path.name for path in small_disk.iterdir()] == ["fill"]


def test_a_writer_that_fails_leaves_what_was_there(tmp_path, monkeypatch, capfd):
    run, out = short_run(tmp_path, duration=5.0), tmp_path / "out"
    assert main(["run", str(run), "--plant", "linear", "--out", str(out)]) == 0
    before = (out / "short.linear.rrd").read_bytes()
    capfd.readouterr()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("icmj.base.files.os.replace", full)
    assert main(["run", str(run), "--plant", "linear", "--out", str(out)]) == 2
    assert "No space left" in the_line(capfd.readouterr().err)
    assert [path.name for path in out.iterdir()] == ["short.linear.rrd"]
    assert (out / "short.linear.rrd").read_bytes() == before


def test_a_folder_that_is_a_file_or_read_only(tmp_path: Path) -> None:
    run = short_run(tmp_path, duration=5.0)
    (tmp_path / "file").write_text("mine")
    (tmp_path / "locked").mkdir()
    (tmp_path / "locked").chmod(0o500)
    places = [tmp_path / "file", tmp_path / "file" / "deeper", tmp_path / ("x" * 300)]
    if os.geteuid() != 0:  # root may write anywhere
        places.append(tmp_path / "locked")
    for command in ("run", "study"):
        for place in places:
            assert "cannot be written to" in refused(command, run, "--out", place)
    assert (tmp_path / "file").read_text() == "mine"
    assert {path.name for path in tmp_path.iterdir()} == {"short.toml", "file", "locked"}


def test_two_studies_into_one_folder_do_not_harm_each_other(tmp_path: Path) -> None:
    run, out = short_run(tmp_path), tmp_path / "out"
    both = [start("study", run, "--out", out, "--jobs", "1", cwd=tmp_path) for _ in range(2)]
    for process in both:
        _, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, err
    check_folder(out)
    names = {"short.linear.rrd", "short.mujoco.rrd", "report.html", "report_figures", "summary.json"}
    assert {path.name for path in out.iterdir()} == names


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize("arguments", [("analyse", "--json"), ("analyse",)])
def test_standard_output_that_is_full_or_gone(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    run = short_run(tmp_path)
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "icmj.cli", arguments[0], str(run), *arguments[1:]]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.strip().splitlines()[-1] == "icmj: No space left on device"
    assert "Exception" not in done.stderr
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, told(done.stderr)) == (0, [])
