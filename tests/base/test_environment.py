"""One thread, unless somebody has asked for more."""

from __future__ import annotations

import os
import subprocess
import sys

from icmj.base.environment import one_thread


def test_what_is_said_already_stays() -> None:
    assert one_thread({})["OPENBLAS_NUM_THREADS"] == "1"
    assert one_thread({"OPENBLAS_NUM_THREADS": "3"})["OPENBLAS_NUM_THREADS"] == "3"
    assert one_thread({"OMP_NUM_THREADS": "2"}) == {"OMP_NUM_THREADS": "2"}


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
    for more, threads in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, str(min(2, os.cpu_count() or 1)))):
        done = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, check=True, env={**bare, **more}
        )
        assert f"threads {threads}" in done.stdout
