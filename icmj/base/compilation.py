"""How this package compiles: with numba, without the GIL, kept on disk so that the next process starts without it.

numba compiles anew when the source file changes that a function stands in, or its closure variables do, but not when a
function does that it calls. So only entry points are kept, and each holds :func:`contents` of the folder of all that it
calls as a closure variable. It must hold nothing else there: another compiled function would be a new one in every
process, and nothing would ever be found on disk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numba

try:
    import fcntl
except ImportError:  # no such locks here: each process compiles
    fcntl = None  # type: ignore[assignment]

TESTED = "0.68."  # numba, with icmj.base.linking


def contents(folder: Path, *more: str) -> int:
    """A number that changes with any Python file in a folder and those beneath it, with this one, and with ``more``."""
    files = [Path(__file__), *sorted(folder.rglob("*.py"))]
    content = b"\0".join([*(file.read_bytes() for file in files), *map(str.encode, more)])
    return int.from_bytes(hashlib.sha256(content).digest()[:6])


def kept(make: Callable[..., Any], options: dict[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    """``make`` with these options, kept on disk where numba finds a folder that it may write to."""

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return make(cache=True, **options)(function)
        except RuntimeError:  # no folder for the cache: compile in every process
            return make(**options)(function)

    return decorate


def entry(function: Callable[..., Any]) -> Any:
    """``numba.njit`` without the GIL, kept on disk; the function must use a closure variable that is the contents."""
    return kept(numba.njit, {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True})(function)


# what only compiled code calls needs no doors for Python and C, which cost as much to compile as what is behind them
WITHIN: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
if numba.__version__.startswith(TESTED):  # its pipeline is not promised to stay; without this, compiling takes longer
    from icmj.base.linking import Linked

    WITHIN["pipeline_class"] = Linked


def known(dispatcher: Any) -> bool:
    """Whether this machine has compiled ``dispatcher`` before, or has nowhere to keep it."""
    folder, code = Path(dispatcher.stats.cache_path or "nowhere"), dispatcher.py_func.__code__
    kept = f"{Path(code.co_filename).stem}.*-{code.co_firstlineno}.*.nbi"
    return bool(dispatcher.overloads) or not folder.is_dir() or any(folder.glob(kept))


@contextmanager
def alone(dispatcher: Any) -> Iterator[None]:
    """While ``dispatcher`` is compiled for the first time on this machine others wait, and find it on disk."""
    with ExitStack() as held:
        if fcntl is not None and not known(dispatcher):
            lock = Path(dispatcher.stats.cache_path) / f"{Path(dispatcher.py_func.__code__.co_filename).stem}.lock"
            with suppress(OSError):  # no right, or a file system without locks: each process compiles
                fcntl.flock(held.enter_context(lock.open("w")), fcntl.LOCK_EX)
        yield


def called(dispatcher: Any, *arguments: Any) -> Any:
    """``dispatcher(*arguments)``, compiled by one process for all."""
    if dispatcher.overloads:
        return dispatcher(*arguments)
    with alone(dispatcher):
        return dispatcher(*arguments)


def compiled(function: Callable[..., Any]) -> Any:
    """A function that entry points call; Python itself must not, it would crash."""
    return numba.njit(**WITHIN)(function)


def summing(function: Callable[..., Any]) -> Any:
    """:func:`compiled`, with sums that may be reassociated, so that they vectorise; the order is fixed all the same."""
    return numba.njit(fastmath={"reassoc", "contract"}, **WITHIN)(function)


def inlined(function: Callable[..., Any]) -> Any:
    """:func:`compiled` into its callers: a call would copy all arguments, which here are many.

    Sums may be reassociated, so that they vectorise; the order is fixed at compile time all the same.
    """
    return numba.njit(fastmath={"reassoc", "contract"}, forceinline=True, **WITHIN)(function)
