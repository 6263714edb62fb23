"""What the process is told at its start: what libraries in other languages read once, and when Python tidies up."""

from __future__ import annotations

import gc
import os
from collections.abc import MutableMapping

LEAST_ROOM = 1 << 30  # bytes
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


def narrow() -> float | None:
    """The room for addresses that this process is allowed [bytes], where that is too little to begin with.

    A library for linear algebra that is loaded into less may never return, and no signal is heard while it tries.
    """
    try:
        import resource
    except ImportError:  # no such limits here
        return None
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if allowed == resource.RLIM_INFINITY or allowed >= LEAST_ROOM else float(allowed)
