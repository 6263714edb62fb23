"""Ended at random moments: nothing half-written, no orphan, no traceback, no litter that stays."""

import os
import random
import signal
import sys
import time
from pathlib import Path

import pytest
from fault_cases import GONE_WITHIN, TALKATIVE, check, check_folder, end, members, moments, says, seen, short_run, start
from patience import PATIENCE

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc"),
]


@pytest.fixture(scope="module")
def seed(pytestconfig: pytest.Config) -> int:
    given = pytestconfig.getoption("--seed")
    return random.randrange(10**6) if given is None else given


def test_a_run_ended_at_any_moment(tmp_path: Path, seed: int, pytestconfig: pytest.Config) -> None:
    run, out = short_run(tmp_path, duration=600.0), tmp_path / "out"
    for signum, after in moments(seed, pytestconfig.getoption("--kills") // 2, 3.0):
        print(f"seed {seed}: run, signal {signum} after {after:.2f} s")
        check(end(start("run", run, "--out", out, cwd=tmp_path), signum, after), signum)
        check_folder(out)
    assert {path.name for path in tmp_path.iterdir()} <= {"short.toml", "out"}


def test_a_study_ended_at_any_moment(tmp_path: Path, seed: int, pytestconfig: pytest.Config) -> None:
    runs, out = tmp_path / "runs", tmp_path / "out"
    runs.mkdir()
    for name in ("one", "two"):
        short_run(runs, name)
    for signum, after in moments(seed + 1, (pytestconfig.getoption("--kills") + 2) // 3, 12.0):
        print(f"seed {seed}: study, signal {signum} after {after:.2f} s")
        check(end(start("study", runs, "--out", out, "--jobs", "2", cwd=tmp_path), signum, after), signum)
        check_folder(out)
    assert {path.name for path in tmp_path.iterdir()} <= {"runs", "out"}


def test_a_run_interrupted_while_it_simulates_keeps_what_there_is(tmp_path: Path) -> None:
    process = start("run", _minute(tmp_path), "--out", tmp_path / "out", "--yes", program=TALKATIVE, cwd=tmp_path)
    says(process, r"short, 1[1-9] %|short, [2-4]\d %")  # of which the simulation is from 10 on
    found = end(process, signal.SIGINT, 0.0)
    assert found.status == 130
    assert "interrupted at" in found.out
    check_folder(tmp_path / "out")
    assert (tmp_path / "out" / "short.mujoco.rrd").exists()


def test_a_second_interrupt_ends_a_run_at_once(tmp_path: Path) -> None:
    run, out = _minute(tmp_path), tmp_path / "out"
    for _ in range(5):  # a busy machine may miss the moment in which the log is written
        process = start("run", run, "--out", out, "--yes", program=TALKATIVE, cwd=tmp_path)
        says(process, r"short, 1[1-9] %|short, [2-4]\d %")
        os.killpg(process.pid, signal.SIGINT)
        seen(lambda: any(out.glob("*short.mujoco.rrd*")))  # of a file that is being written the name begins with a dot
        found = end(process, signal.SIGINT, 0.0)
        assert found.status == 130
        if not (out / "short.mujoco.rrd").exists():
            break
        (out / "short.mujoco.rrd").unlink()
    check(found, signal.SIGINT)
    assert not list(out.glob("*"))
    check_folder(out)


def test_a_log_that_is_being_written_is_written(tmp_path: Path) -> None:
    """The whole run was lost, because of a key pressed in the last second."""
    run, out = short_run(tmp_path, duration=2000.0, more="record_interval = 0.01"), tmp_path / "out"
    process = start("run", run, "--out", out, "--yes", "--plant", "linear", cwd=tmp_path)
    seen(lambda: any(out.glob(".short.linear.rrd*")))
    found = end(process, signal.SIGINT, 0.0)
    assert found.status == 130
    assert found.err.splitlines()[-1] == "icmj: interrupted"
    assert (out / "short.linear.rrd").exists()
    check_folder(out)


def _minute(folder: Path) -> Path:
    """A run that simulates for a minute by small steps, and has few rows."""
    return short_run(folder, duration=40000.0, more="timestep = 0.0005\nrecord_interval = 0.1")


def test_a_run_interrupted_while_it_compiles_ends_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    process = start("run", short_run(tmp_path), "--out", tmp_path / "out", program=TALKATIVE, cwd=tmp_path)
    says(process, r"short.*, compiling \(first run only")
    found = end(process, signal.SIGINT, 0.5)
    check(found, signal.SIGINT)
    assert found.status == 130
    assert not list((tmp_path / "out").glob("*.rrd"))


def workers_of(session: int) -> list[int]:
    """Ids of the processes in which tasks are done."""
    return [process.pid for process in members(session) if "icmj.work.workers" in " ".join(process.cmdline())]


def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    run = short_run(tmp_path, duration=10000.0, more="timestep = 0.0005\nrecord_interval = 0.1")
    process = start("study", run, "--out", tmp_path / "out", "--jobs", "2", "--yes", cwd=tmp_path)
    deadline = time.monotonic() + PATIENCE
    while len(workers_of(process.pid)) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    assert len(workers_of(process.pid)) == 2
    found = end(process, signal.SIGKILL, 0.0)
    assert found.took < GONE_WITHIN / 2


def test_a_worker_that_dies_is_one_line(tmp_path: Path) -> None:
    run = short_run(tmp_path, duration=10000.0, more="timestep = 0.0005\nrecord_interval = 0.1")
    process = start("study", run, "--out", tmp_path / "out", "--jobs", "1", "--yes", cwd=tmp_path)
    deadline = time.monotonic() + PATIENCE
    workers: list[int] = []
    while not workers and time.monotonic() < deadline:
        workers = workers_of(process.pid)
        time.sleep(0.05)
    os.kill(workers[0], signal.SIGKILL)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert "its process died (signal 9)" in err.strip().splitlines()[-1]
    assert "Traceback" not in err
