"""Processes that work for this one, and end when it ends, however it ends.

They are started afresh (MuJoCo's callbacks and numba's threads do not survive a fork), know nothing of Ctrl-C, which is
for this process to handle, and neither write to the terminal nor hold it open. One that dies takes only its own
task with it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from icmj.base import compiling
from icmj.base.environment import one_thread, seldom_collected
from icmj.base.text import one_line
from icmj.errors import IcmjError, StudyError, beyond_arithmetic, beyond_memory

Tell = Callable[[float], None]
_OFTEN = 0.3  # s between two words on progress
_PR_SET_PDEATHSIG = 1
_PROGRAM = "from icmj.work.workers import serve; serve()"


@dataclass(frozen=True)
class Task:
    """A function to call in a worker, importable by name; it is given ``progress``, too.

    Attributes:
        name: for people.
        function: takes ``arguments`` and ``progress``.
        arguments: anything that can be pickled.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class News:
    """A message of a worker: the progress of a task (0–1), or its end with the returned value, or that the worker died.

    Attributes:
        index: the task's place in the order in which they were given.
        done: how far it is, 0–1.
        value: what it returned, once it is done.
        died: how its process ended, where the task died and the others go on; else empty.
    """

    index: int
    done: float
    value: Any = None
    died: str = ""


class _Worker:
    """One process, and the task that it has in hand."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-c", _PROGRAM, str(theirs.fileno()), str(os.getpid())]
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
        environment = one_thread({**os.environ, "PYTHONPATH": paths})
        nothing = subprocess.DEVNULL
        with theirs, _uninterrupted():
            self.process = subprocess.Popen(
                command, stdin=nothing, stdout=nothing, stderr=nothing, pass_fds=(theirs.fileno(),), env=environment
            )
        self.ours = Connection(ours.detach())
        self.index: int | None = None
        self.name = ""

    def give(self, index: int, task: Task) -> None:
        self.index, self.name = index, task.name
        with suppress(OSError):  # it is dead, which shows when it is asked
            self.ours.send((task.function, task.arguments))

    def end(self) -> None:
        compiling.end(self, altogether=True)
        self.process.kill()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(5)
        self.ours.close()


def processors() -> int:
    """Processors that this process may use: a container or a cluster may allot it fewer than the machine has."""
    allotted = getattr(os, "sched_getaffinity", None)  # macOS and Windows have none
    return (os.cpu_count() or 1) if allotted is None else len(allotted(0))


def processes(jobs: int | None, tasks: int | None = None) -> int:
    """The number of processes for so many tasks: ``jobs``, by default one for each processor, and not more than tasks.

    Raises:
        StudyError: if ``jobs`` is no whole number, or not positive.
    """
    if jobs is not None and (isinstance(jobs, bool) or not hasattr(jobs, "__index__") or jobs < 1):
        raise StudyError(f"jobs: {jobs!r}; expected a whole number, at least 1")
    jobs = jobs or processors()
    return jobs if tasks is None else max(1, min(jobs, tasks))


class Workers:
    """So many processes; a context manager, on leaving which they are gone."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._workers: list[_Worker] = []

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        while self._workers:
            self._workers.pop().end()

    def run(self, tasks: Iterable[Task], *, survive: bool = False) -> Iterator[News]:
        """Do all tasks, a few at a time in this order; yields news as they come.

        Args:
            tasks: taken one by one as a process is free for them, so that there may be very many.
            survive: whether a task whose process dies is told as news, and the others go on.

        Raises:
            IcmjError: what a task raised, or that its process died.
        """
        source = iter(enumerate(tasks))
        following = next(source, None)
        while following is not None or any(worker.index is not None for worker in self._workers):
            while following is not None and (worker := self._idle()) is not None:
                worker.give(*following)
                following = next(source, None)
            busy = [worker for worker in self._workers if worker.index is not None]
            spoken = wait([worker.ours for worker in busy])
            for worker in busy:
                if worker.ours in spoken and (news := self._news(worker, survive)) is not None:
                    yield news

    def _idle(self) -> _Worker | None:
        """One that has nothing to do, started if there may be one more."""
        idle = next((worker for worker in self._workers if worker.index is None), None)
        if idle is None and len(self._workers) < self._jobs:
            idle = _Worker()
            self._workers.append(idle)
        return idle

    def _news(self, worker: _Worker, survive: bool) -> News | None:
        """The message about its task; ``None`` if it only reports whether it compiles."""
        index = worker.index
        assert index is not None
        try:
            kind, value = worker.ours.recv()
        except (EOFError, OSError):
            with suppress(subprocess.TimeoutExpired):
                worker.process.wait(5)
            code = worker.process.returncode
            self._workers.remove(worker)
            worker.end()
            why = f"signal {-code}" if code is not None and code < 0 else f"exit status {code}"
            if survive:
                return News(index, 1.0, died=why)
            raise StudyError(
                f"{worker.name}: its process died ({why}); out of memory, or MuJoCo ended it; what was finished is kept"
            ) from None
        if kind == "compiling":
            compiling.begin(worker) if value else compiling.end(worker, altogether=True)
            return None
        if kind == "progress":
            return News(index, value)
        worker.index = None
        if kind == "error":
            raise value
        return News(index, 1.0, value)


def serve() -> None:
    """The program of a worker's process, which runs until its parent is gone."""
    theirs, parent = Connection(int(sys.argv[1])), int(sys.argv[2])
    _mortal(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    seldom_collected()
    compiling.listen(lambda begun: theirs.send(("compiling", begun)))
    with suppress(EOFError, OSError):
        while True:
            function, arguments = theirs.recv()
            theirs.send(_outcome(function, arguments, _teller(theirs)))


def _outcome(function: Callable[..., Any], arguments: tuple[Any, ...], tell: Tell) -> tuple[str, Any]:
    try:
        return "done", function(*arguments, progress=tell)
    except IcmjError as error:
        return "error", type(error)(str(error))
    except Exception as error:
        if beyond_memory(error):
            return "error", StudyError(f"{function.__name__}: out of memory; run fewer jobs, or record more coarsely")
        if beyond_arithmetic(error):
            return "error", StudyError(f"not computable: numbers too far apart ({one_line(error, 200)})")
        frame = error.__traceback__
        while frame is not None and frame.tb_next is not None:
            frame = frame.tb_next
        where = f" at {frame.tb_frame.f_code.co_filename}:{frame.tb_lineno}" if frame else ""
        return "error", RuntimeError(one_line(f"{type(error).__name__}: {error}{where}", 500))


def _teller(theirs: Connection) -> Tell:
    last = time.monotonic()

    def tell(done: float) -> None:
        nonlocal last
        if time.monotonic() - last > _OFTEN:
            last = time.monotonic()
            theirs.send(("progress", done))

    return tell


def _mortal(parent: int) -> None:
    """End when the parent does: at once where the kernel tells (Linux), else within a second."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM, signal.SIGHUP})
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL))

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    if os.getppid() != parent:
        os._exit(1)
    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Signals wait until a process is started and known; they stay blocked in it, and Ctrl-C never reaches it."""
    polite = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, polite)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
