"""Compilation with numba: without the GIL, and cached on disk so that later processes need not compile.

With the environment variable ``ICMJ_INTERPRETED=1`` nothing is compiled: each function here gives back the plain one,
and the same source runs as Python. That is for a debugger, for tests that compare the two, and for a machine on which
compiled code cannot run.

numba compiles anew when the source file changes that a function stands in, or its closure variables do, but not when a
function does that it calls. So only entry points are kept, and each holds :func:`hash_contents` of the folder of all
that it calls as a closure variable. It must hold nothing else there: another compiled function would be a new one in
every process, and nothing would ever be found on disk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import Any

from icmj.base import compile_clock
from icmj.base.process import INTERPRETED

if not INTERPRETED:
    from icmj.base.linking import Linked, c_function, listen, load_from_disk, numba

    listen(compile_clock.begin_compiling, compile_clock.end_compiling)

try:
    import fcntl
except ImportError:  # no such locks here: each process compiles
    fcntl = None  # type: ignore[assignment]


def hash_contents(folder: Path, *more: str) -> int:
    """A hash that changes with any Python file in or below a folder, with this module, and with ``more``."""
    files = [path for place in (Path(__file__).parent, folder) for path in sorted(place.rglob("*.py"))]
    content = b"\0".join([*(file.read_bytes() for file in files), *map(str.encode, more)])
    return int.from_bytes(hashlib.sha256(content).digest()[:6])


def cache_on_disk(make: Callable[..., Any], options: dict[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    """``make`` with these options, kept on disk where numba finds a folder that it may write to."""

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return load_from_disk(make(cache=True, **options)(function))
        except RuntimeError:  # no folder for the cache: compile in every process
            return make(**options)(function)

    return decorate


def entry(function: Callable[..., Any]) -> Any:
    """``numba.njit`` without the GIL, kept on disk; the function must use a closure variable that is the contents."""
    if INTERPRETED:
        return interpret(function)
    return cache_on_disk(numba.njit, {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True})(function)


def c_entry(signature: str) -> Callable[[Callable[..., Any]], Any]:
    """A function that C can call, cached on disk like :func:`entry`; in interpreted mode, the function itself."""
    if INTERPRETED:
        return lambda function: function
    make = cache_on_disk(lambda **options: c_function(signature, **options), {"error_model": "numpy"})
    return lambda function: make(function).ctypes


def interpret(function: Callable[..., Any]) -> Callable[..., Any]:
    """An entry point that Python runs, with the arithmetic of compiled code: 1/0 is infinite, without a warning."""
    import numpy as np

    @wraps(function)
    def run(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*arguments)

    return run


# what only compiled code calls is left without the wrappers by which Python and C would call it: they take as long to
# compile as the function itself; and it is put into its callers where it says so itself, not because its caller is put
# into others: copies of copies made a third of the linear plant's time to compile
WITHIN: dict[str, Any] = {
    "nogil": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "forceinline": False
}  # fmt: skip
if not INTERPRETED:
    # and arrays count references; said, because it is taken from the caller where nothing is said
    WITHIN |= {"pipeline_class": Linked, "_nrt": True}


def _on_disk(dispatcher: Any) -> bool:
    """Whether the disk cache has ``dispatcher``, or there is no disk cache."""
    folder, code = Path(dispatcher.stats.cache_path or "nowhere"), dispatcher.py_func.__code__
    kept = f"{Path(code.co_filename).stem}.*-{code.co_firstlineno}.*.nbi"
    return bool(dispatcher.overloads) or not folder.is_dir() or any(folder.glob(kept))


@contextmanager
def _one_process(dispatcher: Any) -> Iterator[None]:
    """While ``dispatcher`` is compiled for the first time on this machine others wait, and find it on disk."""
    with ExitStack() as held:
        if fcntl is not None and not _on_disk(dispatcher):
            lock = Path(dispatcher.stats.cache_path) / f"{Path(dispatcher.py_func.__code__.co_filename).stem}.lock"
            compile_clock.begin_compiling()  # waiting for another process is waiting for its compiler
            held.callback(compile_clock.end_compiling)
            with suppress(OSError):  # no right, or a file system without locks: each process compiles
                fcntl.flock(held.enter_context(lock.open("w")), fcntl.LOCK_EX)
        yield


def call(dispatcher: Any, *arguments: Any) -> Any:
    """``dispatcher(*arguments)``, compiled by one process for all."""
    if INTERPRETED or dispatcher.overloads:
        return dispatcher(*arguments)
    with _one_process(dispatcher):
        return dispatcher(*arguments)


def within(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of a function that only compiled code calls; Python itself must not, it would crash."""
    if INTERPRETED:
        return lambda function: function
    return numba.njit(**WITHIN | options)


SUMS = {"reassoc", "contract"}
# whoever calls these holds their arrays: counting references to them would be a tenth of a simulation
compiled = within(_nrt=False)
"""A function that entry points call, which neither makes arrays nor returns any; Python must not call it."""
summing = within(fastmath=SUMS, _nrt=False)
"""``compiled``, with sums that may be reassociated, so that they vectorise; the order is fixed all the same."""
fused = within(fastmath={"contract"}, _nrt=False)
"""``compiled``, with products added in one rounding, for a recurrence; its terms stay as they are written."""
inlined = within(fastmath=SUMS, forceinline=True, _nrt=False)
"""``summing``, put into its callers: a call would copy all arguments, which here are many."""
exact = within(forceinline=True, _nrt=False)
"""``inlined``, with every sum in the order written."""
merged = within(inline="always")
"""A function that stands in one entry point as if written there: it is not compiled twice."""
allocating = within()
"""``compiled``, for one that makes arrays."""
viewing = within(fastmath=SUMS, forceinline=True)
"""``inlined``, for one that returns arrays."""
