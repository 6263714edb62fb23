"""What the environment must say before libraries in other languages are loaded, which read it once."""

from __future__ import annotations

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
