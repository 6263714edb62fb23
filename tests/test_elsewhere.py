"""Without what only Linux has, or only Unix: modules, signals, /proc. All is imported, and the commands work."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE
from sweep_cases import GRID, THRESHOLDS, sweep_file

from icmj.engine.fault import library
from icmj.engine.rehearsal import _PROGRAM

# before anything else is imported; libraries have their own ways elsewhere, so it is icmj that finds all this absent
BARE = """
import builtins, io, os, signal, sys
ABSENT = "fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog", "readline", "curses"
for name in ("SIGHUP", "SIGALRM", "setitimer", "getitimer", "ITIMER_REAL", "alarm", "pthread_sigmask"):
    delattr(signal, name)
for name in ("memfd_create", "sched_getaffinity"):
    delattr(os, name)
def ours():
    frame = sys._getframe(2)
    while frame.f_globals.get("__name__") in ("pathlib", "io", "contextlib", "posixpath", "genericpath"):
        frame = frame.f_back
    return frame.f_globals.get("__name__", "").startswith("icmj")
def importing(name, *arguments, load=builtins.__import__, **named):
    if name in ABSENT and ours():
        raise ModuleNotFoundError(f"No module named {name!r}")
    return load(name, *arguments, **named)
def unless_proc(function):
    def found(path, *arguments, **named):
        if str(path).startswith("/proc") and ours():
            raise FileNotFoundError(2, "No such file or directory", str(path))
        return function(path, *arguments, **named)
    return found
builtins.__import__ = importing
for module, name in ((builtins, "open"), (io, "open"), (os, "readlink"), (os, "stat")):
    setattr(module, name, unless_proc(getattr(module, name)))
"""
EVERYTHING = """
import importlib, pkgutil, icmj
for module in pkgutil.walk_packages(icmj.__path__, "icmj."):
    if not module.name.startswith("icmj.shipped.runs."):
        importlib.import_module(module.name)
"""
COMMANDS = """
import sys
from icmj.cli.main import main
for command in {commands!r}:
    status = main(command)
    assert status == 0, (command, status)
"""


def bare(program: str, folder: Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(place for place in sys.path if place)
    environment = {**os.environ, "PYTHONPATH": path, "MPLCONFIGDIR": str(folder)}
    return subprocess.run(
        [sys.executable, "-c", BARE + program],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


def test_every_module_is_imported_without_what_only_linux_has(tmp_path: Path) -> None:
    done = bare(EVERYTHING, tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_command_line_does_its_work_without_what_only_linux_has(tmp_path: Path) -> None:
    many = tmp_path / "many.xml"  # a model that is tried in a process of its own
    bodies = (
        '<body pos="0 0 1"><joint name="lean" axis="0 1 0"/><geom size="0.1"/><replicate count="301" offset="0 0 1">'
    )
    bodies += '<geom size="0.01"/></replicate></body>'
    motor = '<actuator><motor name="torque" joint="lean"/></actuator><sensor><jointpos name="y" joint="lean"/></sensor>'
    many.write_text(f"<mujoco><worldbody>{bodies}</worldbody>{motor}</mujoco>")
    sweep = sweep_file(tmp_path, GRID.format(count=3) + THRESHOLDS)
    short = ["simple-0.8", "--set", "simulation.duration=4.0"]
    commands = [
        ["--help"],
        ["analyse", "simple-0.8"],
        *(["run", *short, "--plant", plant, "--out", f"out-{plant}"] for plant in ("linear", "mujoco")),
        ["export", "out-linear/simple-0.8.linear.rrd", "--to", "csv", "--out", "sway.csv"],
        ["cycle", "simple-0.8"],
        ["linearise", str(many)],
        ["study", *short, "--jobs", "2", "--out", "study", "--yes"],
        ["sweep", str(sweep), "--out", "swept", "--jobs", "2"],
    ]
    done = bare(COMMANDS.format(commands=commands), tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "mistake" not in done.stderr
    assert (tmp_path / "study" / "report.html").is_file()


def test_a_model_is_tried_where_no_limits_can_be_set(tmp_path: Path) -> None:
    """In a process of its own: where there is no ``resource``, or, as on macOS, memory cannot be limited."""
    model = tmp_path / "model.xml"
    model.write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    none = "import sys; sys.modules['resource'] = None\n"
    fails = "import resource\ndef no(*_):\n  raise ValueError('current limit exceeds maximum limit')\n"
    fails += "resource.setrlimit = no\n"
    for before in (none, fails):
        limits = "3", "1000000000", "10", "1000000", "0"
        command = [sys.executable, "-c", before + _PROGRAM, str(library()), str(model), *limits]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
