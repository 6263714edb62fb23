"""The environment of the process: variables that libraries read once at the start, and Python's garbage collection."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager, suppress
from functools import cache
from threading import Lock
from typing import Any

_inside, _lock = 0, Lock()
_before: list[int] = []

LEAST_ROOM = 1 << 30  # bytes
_ARENAS = -8  # M_ARENA_MAX of the GNU C library
INTERPRETED = os.environ.get("ICMJ_INTERPRETED", "") not in ("", "0")
"""Whether what is otherwise compiled runs as plain Python; see :mod:`icmj.base.compilation`."""
SWITCH = "set the environment variable ICMJ_INTERPRETED=1, with which the same code runs as plain Python"
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


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let BLAS work in one thread within the block, or the function that this decorates, whatever the process is told.

    A matrix of some hundred columns is shared out among threads, and what a sum is to the last bit depends on their
    number. The number is the whole process's: who leaves last gives back what was there.
    """
    global _inside, _before
    with _lock:
        if _inside == 0:
            _before = [library.get_num_threads() for library in _libraries()]
            _tell([1] * len(_before))
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _tell(_before)


def _tell(threads: list[int]) -> None:
    for library, number in zip(_libraries(), threads, strict=True):
        # what is public lets but one thread of Python set the number, which need not be the last to leave
        getattr(library, "_real_set_num_threads", library.set_num_threads)(number)


@cache
def _libraries() -> list[Any]:
    """The BLAS of numpy and that of SciPy, which is another one; looked for once, as that takes milliseconds."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return [library for library in ThreadpoolController().lib_controllers if library.user_api == "blas"]


def seldom_collected() -> None:
    """Have Python look for cyclic garbage less often: compiling and drawing make many objects, few in cycles.

    A tenth of the time of both goes into looking otherwise, and a sixth of that of a short run.
    """
    gc.set_threshold(300_000, 10, 10)


def narrow() -> float | None:
    """The limit on this process's address space [bytes] if it is too small to start; ``None`` otherwise.

    A library for linear algebra that is loaded into less may never return, and no signal is heard while it tries.
    """
    allowed = _room()
    return None if allowed is None or allowed >= LEAST_ROOM else allowed


def sparing() -> None:
    """Make allocators reserve little where the address space is limited; must be called before libraries are loaded.

    Each of two allocators reserves addresses by the gigabyte, and by the thread, of which little is ever used: a run
    that peaks at 0.35 GB of memory takes 3.6 GB of addresses, so 1.0 GB. Where reserving fails, code in Rust ends the
    process at once.
    """
    if _room() is None:
        return
    for name, value in (("MIMALLOC_ARENA_RESERVE", "32768"), ("RAYON_NUM_THREADS", "1"), ("TOKIO_WORKER_THREADS", "1")):
        os.environ.setdefault(name, value)
    if "MALLOC_ARENA_MAX" not in os.environ:
        import ctypes

        with suppress(OSError, AttributeError):  # of another C library
            ctypes.CDLL(None).mallopt(_ARENAS, 1)


def _room() -> float | None:
    """The limit on addresses [bytes]; ``None`` where there is none."""
    try:
        import resource
    except ImportError:  # no such limits here
        return None
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if allowed == resource.RLIM_INFINITY else float(allowed)
