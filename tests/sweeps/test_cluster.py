"""The same bytes from a Dask cluster: a real scheduler and two worker processes, one of which is killed midway."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from sweep_cases import GRID, contents, sweep_file

from icmj.errors import SweepError
from icmj.sweeps.chunk import compute
from icmj.sweeps.sweep import Progress, carry_out, planned

pytest.importorskip("distributed")


def started(*words: str, until: str) -> tuple[subprocess.Popen[str], str]:
    """A program of Dask, once it has said what it says when it is ready; and what stood there."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "DASK_DISTRIBUTED__ADMIN__LOW_LEVEL_LOG_LENGTH": "0",
    }
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if found := re.search(until, line):
            return process, found[1]
    raise AssertionError(f"{words[0]} ended before it was ready")


@pytest.fixture
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    running = []
    try:
        process, address = started(
            "scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            "0",
            "--no-dashboard",
            "--no-show",
            until=r"Scheduler at:\s+(\S+)",
        )
        running.append(process)
        for _ in range(2):
            worker, _ = started(
                "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1",
                until=r"(Registered to)",
            )  # fmt: skip
            running.append(worker)
        yield address, running[1:]
    finally:
        for process in reversed(running):
            process.kill()
            process.wait()
            process.stderr.close()


@pytest.mark.slow
def test_a_worker_killed_midway_loses_nothing(tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[str]]]) -> None:
    address, workers = cluster
    plan = planned(sweep_file(tmp_path, GRID.format(count=120), chunk=2))
    seen: list[Progress] = []

    def tell(progress: Progress) -> None:
        seen.append(progress)
        if len(seen) == 5:
            workers[0].send_signal(signal.SIGKILL)
            workers[0].wait()

    carry_out(plan, tmp_path / "out", dask=address, progress=tell)
    assert workers[0].returncode == -signal.SIGKILL
    assert workers[1].poll() is None
    assert [progress.done for progress in seen] == list(range(2, 122, 2))
    assert contents(tmp_path / "out") == {
        f"{i:08d}.parquet": compute(plan, plan.range(i)).content for i in range(plan.chunks)
    }


def test_no_scheduler_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from icmj.sweeps import cluster

    monkeypatch.setattr(cluster, "_PATIENCE", 0.3)
    plan = planned(sweep_file(tmp_path, GRID.format(count=2)))
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(SweepError, match="no scheduler answers there"):
            carry_out(plan, tmp_path / "out", dask=address)
    assert not (tmp_path / "out").exists()
