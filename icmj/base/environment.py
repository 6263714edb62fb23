"""What the process is told at its start: what libraries in other languages read once, and when Python tidies up."""

from __future__ import annotations

import gc
import os
from collections.abc import MutableMapping

_BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def one_thread(environment: MutableMapping[str, str] | None = None) -> MutableMapping[str, str]:
    """Let BLAS work in one thread, in ``environment`` (by default this process's), unless it says otherwise already.

    The matrices here are small: more threads only wait for each other, which takes a third more of the processor, and
    sums depend on their number in the last bit.
    """
    environment = os.environ if environment is None else environment
    if "OMP_NUM_THREADS" not in environment:
        for name in _BLAS:
            environment.setdefault(name, "1")
    return environment


def seldom_collected() -> None:
    """Have Python look for cyclic garbage less often: compiling and drawing make many objects, few in cycles.

    A tenth of the time of both goes into looking otherwise.
    """
    gc.set_threshold(30_000, 10, 10)
