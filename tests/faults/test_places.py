"""What stands where something is to be written: a pipe, a socket, a device, a link; refused before any work is done."""

import os
import socket
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
from fault_cases import short_run
from terminal_cases import told

from icmj.cli.main import main

ROOT = Path(__file__).resolve().parent.parent.parent


def device(path: Path) -> None:
    """A node of its own that leads to nothing: major and minor number 0 belong to no driver."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(0, 0))
    except OSError:
        pytest.skip("no right to make a device node")


def listening(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as found:
        here = Path.cwd()
        os.chdir(path.parent)  # the name of a socket is short
        try:
            found.bind(path.name)
        finally:
            os.chdir(here)


def dangling(path: Path) -> None:
    path.symlink_to(path.parent / "nobody")


def linked(path: Path) -> None:
    (path.parent / "precious").write_text("mine")
    path.symlink_to("precious")


ODD: dict[str, Callable[[Path], object]] = {
    "pipe": os.mkfifo, "socket": listening, "device": device,
    "link": linked, "dangling link": dangling, "folder": Path.mkdir,
}  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("log")
    assert main(["run", str(short_run(folder, duration=5.0)), "--plant", "linear", "--out", str(folder)]) == 0
    return folder / "short.linear.rrd"


# the command, and the names of the files that it writes
COMMANDS = {
    "run": (["run", "{run}", "--plant", "linear", "--out", "out"], ["out/short.linear.rrd"]),
    "study": (
        ["study", "{run}", "--jobs", "1", "--out", "out"],
        ["out/short.mujoco.rrd", "out/report.html", "out/summary.json"],
    ),
    "continue": (
        ["continue", "{run}", "--parameter", "b", "--to", "0.81", "--points", "3", "--plant", "linear", "--out", "out"],
        ["out/short.b.linear.parquet", "out/short.b.linear.rrd", "out/short.b.linear.pdf"],
    ),
    "report": (["report", "{log}", "--out", "page.html"], ["page.html"]),
    "export": (["export", "{log}", "--out", "a.csv"], ["a.csv", "a.events.csv"]),
    "linearise": (["linearise", "pendulum", "--out", "a.npz"], ["a.npz"]),
    "person": (["person", "three_link", "--height", "1.7", "--mass", "70", "--out", "a.xml"], ["a.xml"]),
    "new": (["new", "three_link", "--out", "a.toml"], ["a.toml"]),
    "new of a case": (["new", "simple-0.8", "--out", "a.toml"], ["a.toml", "pendulum.xml"]),
    "new of a sweep": (["new", "sweep", "--out", "a.toml"], ["a.toml"]),
    "new of a family": (["new", "event", "--out", "a.toml"], ["a.toml", "standing-intermittent.toml"]),
    "replay": (["replay", "{log}", "--screenshot", "a.png"], ["a.png"]),
}


@pytest.mark.slow
# a study takes seconds to look at its inputs
@pytest.mark.parametrize(("command", "kind"), [(c, k) for c in COMMANDS for k in ODD if c != "study" or k == "pipe"])
def test_nothing_but_a_file_is_replaced(command, kind, log, tmp_path, monkeypatch, capfd):
    run = short_run(tmp_path, duration=5.0)
    words, targets = COMMANDS[command]
    for i, name in enumerate(targets):
        here = tmp_path / str(i)
        target = here / name
        target.parent.mkdir(parents=True)
        monkeypatch.chdir(here)
        ODD[kind](target)
        before = {path.relative_to(here): path.lstat().st_ino for path in here.rglob("*")}
        assert main([word.format(run=run, log=log) for word in words]) == 2
        said = capfd.readouterr()
        (line,) = told(said.err)
        assert said.out == ""
        assert target.name in line
        assert f"a {kind.split()[-1]} is there" in line or "exists already" in line
        # as it was, and nothing beside it, and nothing where a link leads
        assert {path.relative_to(here): path.lstat().st_ino for path in here.rglob("*")} == before
        assert not (target.parent / "nobody").exists()
        if kind == "link":
            assert (target.parent / "precious").read_text() == "mine"


@pytest.mark.parametrize("kind", [kind for kind in ODD if kind != "folder"])
def test_a_folder_for_outputs_may_be_a_link_to_one_and_nothing_else(kind, tmp_path, capfd):
    run, out = short_run(tmp_path, duration=5.0), tmp_path / "out"
    ODD[kind](out)
    inode = out.lstat().st_ino
    assert main(["run", str(run), "--plant", "linear", "--out", str(out)]) == 2
    assert "cannot be written to" in capfd.readouterr().err
    assert out.lstat().st_ino == inode
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "folder").symlink_to("elsewhere")
    assert main(["run", str(run), "--plant", "linear", "--out", str(tmp_path / "folder")]) == 0
    assert (tmp_path / "elsewhere" / "short.linear.rrd").is_file()
