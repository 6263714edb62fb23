"""The process: its environment, its signals, what it imports in the background, and whether it compiles.

The environment of the process: variables that libraries read once at the start, and Python's garbage collection.

A request to terminate, which unwinds the current work like Ctrl-C, so that no files are left behind.

The import of a module that is needed later, in the background.

Whether something is compiled for the first time, in this process or in one that works for it, and for how long.

Compiling takes about ten seconds after installation. Whoever shows what is under way asks :func:`compiling`, and of
the time that passes how much of it is :func:`spent` so; a worker process passes its own state on by :func:`listen`.

A program in a process of its own, held to limits: a damaged file or a crashing model ends it, and not this one.

Independence of the working folder, in which somebody else's data may lie: nothing there is imported or sets anything.
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Hashable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import AbstractContextManager, chdir, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from threading import Lock
from types import FrameType
from typing import Any

LEAST_ROOM = 1 << 30  # bytes
_ARENAS = -8  # M_ARENA_MAX of the GNU C library
INTERPRETED = any(os.environ.get(name, "") not in ("", "0") for name in ("ICMJ_INTERPRETED", "NUMBA_DISABLE_JIT"))
"""Whether what is otherwise compiled runs as plain Python, as numba is asked to by a variable of its own, too; see
:mod:`icmj.base.compilation`."""
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
    before = [library.get_num_threads() for library in _libraries()]
    _set_threads([1] * len(before))
    try:
        yield
    finally:
        _set_threads(before)


def _set_threads(threads: list[int]) -> None:
    for library, number in zip(_libraries(), threads, strict=True):
        # a library of which one thread of Python sets the number, until it gives this up: the lock here sees to that
        release = getattr(library, "clear_controlling_thread", lambda *, force: None)
        release(force=True)
        library.set_num_threads(number)
        release(force=True)


@cache
def _libraries() -> list[Any]:
    """The BLAS of numpy and that of SciPy, which is another one; looked for once, as that takes milliseconds."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return [library for library in ThreadpoolController().lib_controllers if library.user_api == "blas"]


def collect_garbage_seldom() -> None:
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


_POLITE = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
_ALARM = getattr(signal, "SIGALRM", None)  # not everywhere; where it is not, or somebody's, nothing is said twice
_AGAIN = 1.0  # s


class Termination(BaseException):
    """The process was asked to end.

    Attributes:
        status: exit status, 128 and the number of the signal.
    """

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.status = 128 + signum


@dataclass
class EndRequest:
    """Whether, and by which signal, the process was asked to end; 0 if it was not."""

    signum: int = 0


@contextmanager
def terminable() -> Iterator[EndRequest]:
    """Within the block SIGTERM and SIGHUP raise :class:`Termination`, unless they are ignored or have a handler.

    Code in other languages may turn an exception that falls into it into another one, or lose it. So what is yielded
    remembers, and the exception is raised again every second until the block is left. So is KeyboardInterrupt, but
    for what is :func:`interrupt_once`. Signals reach the main thread only; in another thread the block changes nothing.
    """
    asked = EndRequest()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    before: dict[int, Any] = {}

    def ring(after: float, again: float) -> None:
        if _ALARM in before:
            signal.setitimer(signal.ITIMER_REAL, after, again)

    def stop(signum: int, _: object) -> None:
        if signum != _ALARM:
            asked.signum = signum
            ring(_AGAIN, _AGAIN)
        if asked.signum == signal.SIGINT:
            raise KeyboardInterrupt
        raise Termination(asked.signum)

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        if lost.exc_type in (Termination, KeyboardInterrupt):  # it fell into a destructor, which cannot end anything
            ring(0.01, signal.getitimer(signal.ITIMER_REAL)[1] if _ALARM in before else 0.0)
        else:
            hook(lost)

    for signum in (*_POLITE, *([_ALARM] if _ALARM else [])):
        if signal.getsignal(signum) is signal.SIG_DFL:
            before[signum] = signal.signal(signum, stop)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, stop)
    hook = sys.unraisablehook
    sys.unraisablehook = unraisable
    try:
        yield asked
    finally:
        sys.unraisablehook = hook
        ring(0.0, 0.0)
        for signum, handler in before.items():
            signal.signal(signum, handler)


@dataclass
class Interrupt:
    """Ctrl-C within :func:`interrupt_once`."""

    count: int = 0
    waits: bool = False

    @contextmanager
    def postpone(self) -> Iterator[None]:
        """Within the block the first Ctrl-C waits until its end."""
        before, self.waits = self.count, True
        try:
            yield
        finally:
            self.waits = False
        if before == 0 and self.count:
            raise KeyboardInterrupt


@contextmanager
def defer_interrupt() -> Iterator[None]:
    """Defer Ctrl-C to the end of the block, which is short, so that related changes are made together.

    In another thread than the main one it changes nothing.
    """
    before, late = signal.getsignal(signal.SIGINT), list[tuple[int, FrameType | None]]()
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    signal.signal(signal.SIGINT, lambda signum, frame: late.append((signum, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if late:
        before(*late[-1])


@contextmanager
def interrupt_once() -> Iterator[Interrupt]:
    """Within the block Ctrl-C raises KeyboardInterrupt once; the code that catches it keeps its results and goes on.

    A second one raises :class:`Termination`, which nothing catches that keeps anything. Without a :func:`terminable`
    around it, or in another thread than the main one, it changes nothing.
    """
    before, heard = signal.getsignal(signal.SIGINT), Interrupt()
    bare = not callable(before) or before is signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or bare:
        yield heard
        return
    handler: Callable[[int, FrameType | None], Any] = before  # type: ignore[assignment]

    def once(signum: int, frame: FrameType | None) -> None:
        heard.count += 1
        if heard.count > 1:
            raise Termination(signum)
        if heard.waits:
            return
        try:
            handler(signum, frame)
        finally:
            if _ALARM and signal.getsignal(_ALARM) is handler:  # not somebody else's
                signal.setitimer(signal.ITIMER_REAL, 0)

    signal.signal(signal.SIGINT, once)
    try:
        yield heard
    finally:
        signal.signal(signal.SIGINT, before)


def meanwhile(name: str) -> None:
    """Import a module that is needed later, in a separate thread, while compiled code computes.

    Whoever imports it then waits for it; what goes wrong with it shows there.
    """

    def load() -> None:
        with suppress(Exception):
            import_module(name)

    threading.Thread(target=load, name=f"import {name}", daemon=True).start()


USUAL = 10.0  # s that a loop takes to compile on a processor that does nothing else

_under_way: dict[Hashable, int] = {}
_listeners: list[Callable[[bool], None]] = []
_since, _compiled_before = 0.0, 0.0  # when the present compilation began, and what all before it took [s]


def compiling() -> bool:
    """Whether something is being compiled now."""
    return bool(_under_way)


def spent() -> float:
    """Seconds since the start of this process during which something was compiled."""
    return _compiled_before + (time.monotonic() - _since if _under_way else 0.0)


def begin_compiling(who: Hashable = "here") -> None:
    """``who`` compiles; every beginning needs its :func:`end`."""
    global _since
    if not _under_way:
        _since = time.monotonic()
    _under_way[who] = _under_way.get(who, 0) + 1
    _report()


def end_compiling(who: Hashable = "here", *, altogether: bool = False) -> None:
    """``who`` has finished compiling once, or does not compile any more at all."""
    global _compiled_before
    before = spent()
    left = 0 if altogether else _under_way.get(who, 0) - 1
    if left > 0:
        _under_way[who] = left
    else:
        _under_way.pop(who, None)
    if not _under_way:
        _compiled_before = before
    _report()


def listen_to_compiling(listener: Callable[[bool], None]) -> None:
    """Call ``listener`` with :func:`compiling` whenever something begins or ends."""
    _listeners.append(listener)


def _report() -> None:
    for listener in _listeners:
        listener(compiling())


def run_bounded(
    command: Sequence[str],
    clock: float,
    *,
    processor: int | None = None,
    addresses: int | None = None,
    data: int | None = None,
    stack: int | None = None,
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run a program without input and without a core dump; what it writes to standard error is kept.

    The shell sets the limits, because setting them in Python between fork and exec is not safe with threads. Those that
    the system does not have, or that lie above its own, are left out; the one on the clock always holds.

    Args:
        command: the program and its arguments.
        clock: longest time [s].
        processor: longest processor time [s].
        addresses, data, stack: most memory in all, of data, and of the stack [bytes].
        environment: variables beside those of this process.

    Raises:
        subprocess.TimeoutExpired: if it takes longer than ``clock``.
    """
    words = list(command)
    if os.name == "posix":
        sizes = {"v": addresses, "d": data, "s": stack}
        limits = {kind: size >> 10 for kind, size in sizes.items() if size is not None}
        limits |= {"c": 0} if processor is None else {"c": 0, "t": processor}
        shell = "; ".join(f"ulimit -{kind} {most} 2>/dev/null" for kind, most in limits.items())
        words = ["/bin/sh", "-c", f'{shell}; exec "$@"', "sh", *words]
    return subprocess.run(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        timeout=clock,
        check=False,
        env={**os.environ, **(environment or {})},
    )


def load_matplotlib_apart() -> None:
    """Load matplotlib without ``matplotlibrc`` of the working folder, if there is one; for a process of icmj alone.

    matplotlib looks there first when it is imported. Its settings are then those of the user's own folder, or of the
    file that the environment names. No other thread may be at work yet: the process leaves the folder for the import.
    """
    if not os.path.lexists("matplotlibrc"):
        return
    for name in ("MATPLOTLIBRC", "MPLCONFIGDIR"):
        if os.environ.get(name):
            os.environ[name] = os.path.abspath(os.environ[name])
    with chdir(os.path.dirname(os.path.abspath(__file__))), suppress(ImportError):
        import_module("matplotlib")
