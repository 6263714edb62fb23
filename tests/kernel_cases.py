"""Processes that compute as other processors do: OpenBLAS with other kernels, other numbers of threads."""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

TESTS = Path(__file__).resolve().parent


@cache
def kernels() -> tuple[str, ...]:
    """Kernels of OpenBLAS that this processor can run, the plainest first; one that is none of them where not x86."""
    try:
        flags = Path("/proc/cpuinfo").read_text().split()
    except OSError:
        return ("",)
    needed = {"Prescott": "pni", "Sandybridge": "avx", "Haswell": "avx2", "SkylakeX": "avx512f"}
    return tuple(name for name, flag in needed.items() if flag in flags) or ("",)


def computed(program: str, kernel: str = "", threads: int = 1) -> str:
    """What a program in Python prints, run with the tests' own modules on its path."""
    path = os.pathsep.join([str(TESTS), *(place for place in sys.path if place)])
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)}
    environment |= {"PYTHONPATH": path} | ({"OPENBLAS_CORETYPE": kernel} if kernel else {})
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout
