"""The same bytes from a Dask cluster: a real scheduler and two worker processes, one of which is killed midway."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_cases import start
from patience import PATIENCE
from sweep_cases import GRID, computed, contents, sweep_file
from terminal_cases import told

from icmj.errors import SweepError
from icmj.study.chunk import compute
from icmj.study.sweep import Progress, carry_out, make_plan

pytest.importorskip("distributed")


def started(*words: str, until: str) -> tuple[subprocess.Popen[str], str]:
    """A program of Dask, once it has said what it says when it is ready; and what stood there."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "DASK_DISTRIBUTED__ADMIN__LOW_LEVEL_LOG_LENGTH": "0",
    }
    command = [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    for line in process.stderr:
        if found := re.search(until, line):
            return process, found[1]
    raise AssertionError(f"{words[0]} ended before it was ready")


# gives a scheduler ten seconds to come back instead of thirty
HASTY = "-c", "from icmj.work import workers; workers._ANSWER = 10.0; from icmj.cli import main; main.entry()"


@pytest.fixture
def processes() -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    running = []
    try:
        here = ("--host", "127.0.0.1", "--no-dashboard")
        ready = r"Scheduler at:\s+(\S+)"
        process, address = started("scheduler", *here, "--port", "0", "--no-show", until=ready)
        running.append(process)
        for _ in range(2):
            alone = ("--nthreads", "1", "--no-nanny")
            running.append(started("worker", address, *here, *alone, until=r"(Registered to)")[0])
        yield address, running
    finally:
        for process in reversed(running):
            process.kill()
            process.wait()
            process.stderr.close()


@pytest.fixture
def cluster(processes: tuple[str, list[subprocess.Popen[str]]]) -> tuple[str, list[subprocess.Popen[str]]]:
    """The address of the scheduler, and its workers."""
    return processes[0], processes[1][1:]


@pytest.mark.slow
def test_a_scheduler_killed_midway_is_one_line(tmp_path, processes):
    """It ended in tracebacks of libraries, and "cannot be written to: None"."""
    address, (scheduler, *_) = processes
    file, out = sweep_file(tmp_path, GRID.format(count=4000), chunk=2), tmp_path / "out"
    process = start("sweep", file, "--dask", address, "--out", out, program=HASTY, cwd=tmp_path)
    deadline = time.monotonic() + PATIENCE
    while len(list(out.glob("points/*"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.05)
    scheduler.kill()
    _, err = process.communicate(timeout=PATIENCE)
    lines = told(err)
    assert process.returncode == 2
    assert lines[-1] == "icmj: the scheduler of the cluster no longer answers; finished results are kept"
    assert len(lines) == 2
    assert "chunks are finished" in lines[0]


def test_a_result_that_cannot_be_fetched_is_not_the_workers_fault() -> None:
    """The connection closes before the client knows that it has, once in some hundred times."""
    from distributed.comm.core import CommClosedError

    from icmj.work.workers import Cluster, _outcome

    class Future:
        def __init__(self, error: Exception) -> None:
            self.error = error

        def result(self) -> None:
            raise self.error

    class Running:
        status = "running"

    for error, words in (
        (CommClosedError("in <TCP (closed) ConnectionPool.gather>"), "the scheduler of the cluster no longer answers"),
        (ConnectionResetError(104, "Connection reset by peer"), "the scheduler of the cluster no longer answers"),
        (ImportError("No module named icmj"), r"a worker of the cluster cannot compute \(ImportError: No module"),
    ):
        with pytest.raises(SweepError, match=words), Cluster(Running(), compute)._there():
            _outcome(Future(error))


@pytest.mark.slow
def test_a_worker_killed_midway_loses_nothing(tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[str]]]) -> None:
    address, workers = cluster
    plan = make_plan(sweep_file(tmp_path, GRID.format(count=40), chunk=2))
    seen: list[Progress] = []

    def tell(progress: Progress) -> None:
        seen.append(progress)
        if len(seen) == 5:
            workers[0].send_signal(signal.SIGKILL)
            workers[0].wait()

    carry_out(plan, tmp_path / "out", dask=address, progress=tell)
    assert workers[0].returncode == -signal.SIGKILL
    assert workers[1].poll() is None
    assert [progress.done for progress in seen] == list(range(2, 42, 2))
    assert contents(tmp_path / "out") == computed(plan)


@pytest.mark.slow
def test_a_scheduler_without_workers_is_told_so(
    tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[str]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the beginning, or once they are gone: it waited without end, and without a word."""
    from icmj.work import workers

    monkeypatch.setattr(workers, "_WORKERLESS", 1.0)
    address, running = cluster
    for worker in running:
        worker.terminate()
        worker.wait()
    plan = make_plan(sweep_file(tmp_path, GRID.format(count=2)))
    with pytest.raises(SweepError, match="the scheduler has had no workers for 1 s; start some"):
        carry_out(plan, tmp_path / "out", dask=address)


def test_no_scheduler_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from icmj.work import workers

    monkeypatch.setattr(workers, "_ANSWER", 0.3)
    plan = make_plan(sweep_file(tmp_path, GRID.format(count=2)))
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(SweepError, match="no scheduler answers there"):
            carry_out(plan, tmp_path / "out", dask=address)
    assert not (tmp_path / "out").exists()
