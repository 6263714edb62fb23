"""BLAS in one thread: the matrices here are small, and sums depend on the number of threads in the last bit."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from threading import Lock
from typing import Any

_BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def set_one_thread(environment: MutableMapping[str, str] | None = None) -> MutableMapping[str, str]:
    """Let BLAS work in one thread, in ``environment`` (by default this process's), unless it says otherwise already.

    The matrices here are small: more threads only wait for each other, which takes a third more of the processor, and
    sums depend on their number in the last bit.
    """
    environment = os.environ if environment is None else environment
    if "OMP_NUM_THREADS" not in environment:
        for name in _BLAS:
            environment.setdefault(name, "1")
    return environment


class SharedBlock:
    """A block that any number of threads may be in at once: it begins with the first of them, and ends with the last.

    An instance is called for a ``with`` statement or as a decorator, as the function that it is made of would be.
    """

    def __init__(self, make: Callable[[], AbstractContextManager[object]]) -> None:
        """``make`` gives what is entered and left."""
        self._make, self._lock, self._inside = make, Lock(), 0
        self._block: AbstractContextManager[object]

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """One stay in the block."""
        with self._lock:
            if self._inside == 0:
                self._block = self._make()
                self._block.__enter__()
            self._inside += 1
        try:
            yield
        finally:
            with self._lock:
                self._inside -= 1
                if self._inside == 0:
                    self._block.__exit__(None, None, None)


# Python has one list of what to say for the whole process, which blocks of different threads would leave to each other
ignore_warnings = SharedBlock(lambda: warnings.catch_warnings(action="ignore"))


@SharedBlock
@contextmanager
def limit_to_one_thread() -> Iterator[None]:
    """Let BLAS work in one thread within the block, or the function that this decorates, whatever the process is told.

    A matrix of some hundred columns is shared out among threads, and what a sum is to the last bit depends on their
    number. The number is the whole process's: who leaves last gives back what was there.
    """
    before = [library.get_num_threads() for library in find_libraries()]
    _set_threads([1] * len(before))
    try:
        yield
    finally:
        _set_threads(before)


def _set_threads(threads: list[int]) -> None:
    for library, number in zip(find_libraries(), threads, strict=True):
        # a library of which one thread of Python sets the number, until it gives this up: the lock here sees to that
        release = getattr(library, "clear_controlling_thread", lambda *, force: None)
        release(force=True)
        library.set_num_threads(number)
        release(force=True)


@cache
def find_libraries() -> list[Any]:
    """The BLAS of numpy and that of SciPy, which is another one; looked for once, as that takes milliseconds."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return [library for library in ThreadpoolController().lib_controllers if library.user_api == "blas"]
