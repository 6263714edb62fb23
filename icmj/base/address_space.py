"""Memory where the address space of a process is limited: whether it is too small to start, and what is reserved."""

from __future__ import annotations

import os
from contextlib import suppress

LEAST_ROOM = 1 << 30  # bytes
_ARENAS = -8  # M_ARENA_MAX of the GNU C library


def address_space_too_small() -> float | None:
    """The limit on this process's address space [bytes] if it is too small to start; ``None`` otherwise.

    A library for linear algebra that is loaded into less may never return, and no signal is heard while it tries.
    """
    allowed = find_limit()
    return None if allowed is None or allowed >= LEAST_ROOM else allowed


def reserve_little() -> None:
    """Make allocators reserve little where the address space is limited; must be called before libraries are loaded.

    Each of two allocators reserves addresses by the gigabyte, and by the thread, of which little is ever used: a run
    that peaks at 0.35 GB of memory takes 3.6 GB of addresses, so 1.0 GB. Where reserving fails, code in Rust ends the
    process at once.
    """
    if find_limit() is None:
        return
    for name, value in (("MIMALLOC_ARENA_RESERVE", "32768"), ("RAYON_NUM_THREADS", "1"), ("TOKIO_WORKER_THREADS", "1")):
        os.environ.setdefault(name, value)
    if "MALLOC_ARENA_MAX" not in os.environ:
        import ctypes

        with suppress(OSError, AttributeError):  # of another C library
            ctypes.CDLL(None).mallopt(_ARENAS, 1)


def find_limit() -> float | None:
    """The limit on addresses [bytes]; ``None`` where there is none."""
    try:
        import resource
    except ImportError:  # no such limits here
        return None
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if allowed == resource.RLIM_INFINITY else float(allowed)
