"""One thread, unless somebody has asked for more."""

import os
import subprocess
import sys
import warnings
from pathlib import Path
from threading import Barrier, Event, Thread

import numpy.linalg  # noqa: F401
import pytest
import scipy.linalg  # noqa: F401
from patience import PATIENCE
from threadpoolctl import threadpool_info, threadpool_limits

import icmj
from icmj.base.blas_threads import ignore_warnings, limit_to_one_thread, set_one_thread
from icmj.work.workers import processors


def test_what_is_said_already_stays() -> None:
    assert set_one_thread({})["OPENBLAS_NUM_THREADS"] == "1"
    assert set_one_thread({"OPENBLAS_NUM_THREADS": "3"})["OPENBLAS_NUM_THREADS"] == "3"
    assert set_one_thread({"OMP_NUM_THREADS": "2"}) == {"OMP_NUM_THREADS": "2"}


def test_the_command_line_computes_in_one_thread_and_seldom_looks_for_garbage() -> None:
    script = """
import gc
from icmj.cli.main import main
main(["--version"])
assert gc.isenabled() and gc.get_threshold()[0] > 2000
import numpy
from threadpoolctl import threadpool_info
print("threads", *{pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"})
"""
    bare = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    for more, threads in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, str(min(2, processors())))):
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env={**bare, **more})
        assert f"threads {threads}" in done.stdout


def blas() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@limit_to_one_thread()
def nested() -> set[int]:
    with limit_to_one_thread():
        pass
    return blas()


def test_within_one_thread_and_afterwards_as_before() -> None:
    with threadpool_limits(3, "blas"):
        before = blas()
        assert nested() == {1}
        assert blas() == before
        with pytest.raises(ValueError, match="x"), limit_to_one_thread():
            raise ValueError("x")
        assert blas() == before


def test_who_leaves_last_gives_back() -> None:
    """Two threads of Python within at once: the first to leave must not give the second more threads of BLAS."""
    found, both, left = [], Barrier(2), Barrier(2)

    def first() -> None:
        with limit_to_one_thread():
            both.wait(PATIENCE)
        left.wait(PATIENCE)

    def second() -> None:
        with limit_to_one_thread():
            both.wait(PATIENCE)
            left.wait(PATIENCE)
            found.append(blas())

    with threadpool_limits(3, "blas"):
        before = blas()
        threads = [Thread(target=work) for work in (first, second)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert found == [{1}]
        assert blas() == before


def test_what_python_says_is_as_before_when_the_last_thread_has_left() -> None:
    """The list of filters is the process's: the second to enter would keep what the first had set."""
    entered, both, left, found = Event(), Barrier(2), Barrier(2), []

    def first() -> None:
        with ignore_warnings():
            entered.set()
            both.wait(PATIENCE)
        left.wait(PATIENCE)

    def second() -> None:
        entered.wait(PATIENCE)
        with ignore_warnings():
            both.wait(PATIENCE)
            left.wait(PATIENCE)
            found.append(warnings.filters[0][0])

    before = list(warnings.filters)
    threads = [Thread(target=work) for work in (first, second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == ["ignore"]
    assert warnings.filters == before


def test_nobody_else_changes_what_python_says() -> None:
    sources = Path(icmj.__file__).parent.rglob("*.py")
    found = {path.name for path in sources if "catch_warnings" in path.read_text(encoding="utf-8")}
    assert found == {"blas_threads.py", "main.py"}  # the command line asks once, in its only thread
