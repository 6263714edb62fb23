"""Processes that work for this one, and end when it ends, however it ends.

They are started afresh (MuJoCo's callbacks and numba's threads do not survive a fork), know nothing of Ctrl-C, which is
for this process to handle, and neither write to the terminal nor hold it open. One that dies takes only its own
task with it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection, get_context
from typing import Any

from icmj.base.text import one_line
from icmj.errors import IcmjError, StudyError

Tell = Callable[[float], None]
_OFTEN = 0.3  # s between two words on progress
_PR_SET_PDEATHSIG = 1


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
    """What a worker has to tell: how far a task is (0–1), or that it is done, with what it returned."""

    index: int
    done: float
    value: Any = None


class _Worker:
    """One process, and the task that it has in hand."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self.ours, theirs = context.Pipe()
        # daemonic: ends with this process also where nobody closes the pool
        self.process = context.Process(target=_serve, args=(theirs, os.getpid()), daemon=True)
        with _uninterrupted():
            self.process.start()
        theirs.close()
        self.index: int | None = None

    def give(self, index: int, task: Task) -> None:
        self.index = index
        with suppress(OSError):  # it is dead, which shows when it is asked
            self.ours.send((task.function, task.arguments))

    def end(self) -> None:
        self.process.kill()
        self.process.join(5)
        self.ours.close()


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

    def run(self, tasks: Sequence[Task]) -> Iterator[News]:
        """Do all tasks, a few at a time in this order; yields news as they come.

        Raises:
            IcmjError: what a task raised, or that its process died.
        """
        waiting = list(enumerate(tasks))[::-1]
        while waiting or any(worker.index is not None for worker in self._workers):
            while len(self._workers) < min(self._jobs, len(tasks)):
                self._workers.append(_Worker())
            for worker in self._workers:
                if worker.index is None and waiting:
                    worker.give(*waiting.pop())
            busy = {worker.ours: worker for worker in self._workers if worker.index is not None}
            for end in connection.wait(list(busy)):
                yield self._news(busy[end], tasks)  # type: ignore[index]

    def _news(self, worker: _Worker, tasks: Sequence[Task]) -> News:
        index = worker.index
        assert index is not None
        try:
            kind, value = worker.ours.recv()
        except (EOFError, OSError):
            worker.process.join(5)
            code = worker.process.exitcode
            self._workers.remove(worker)
            worker.end()
            why = f"signal {-code}" if code is not None and code < 0 else f"exit status {code}"
            raise StudyError(
                f"{tasks[index].name}: its process died ({why}); out of memory, or MuJoCo ended it; what was finished "
                "is kept"
            ) from None
        if kind == "progress":
            return News(index, value)
        worker.index = None
        if kind == "error":
            raise value
        return News(index, 1.0, value)


def _serve(theirs: connection.Connection, parent: int) -> None:
    """What a worker does until its parent is gone."""
    _mortal(parent)
    _quiet()
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            function, arguments = theirs.recv()
            theirs.send(_outcome(function, arguments, _teller(theirs)))


def _outcome(function: Callable[..., Any], arguments: tuple[Any, ...], tell: Tell) -> tuple[str, Any]:
    try:
        return "done", function(*arguments, progress=tell)
    except IcmjError as error:
        return "error", type(error)(str(error))
    except MemoryError:
        return "error", StudyError(f"{function.__name__}: out of memory; run fewer jobs, or record more coarsely")
    except Exception as error:
        frame = error.__traceback__
        while frame is not None and frame.tb_next is not None:
            frame = frame.tb_next
        where = f" at {frame.tb_frame.f_code.co_filename}:{frame.tb_lineno}" if frame else ""
        return "error", RuntimeError(one_line(f"{type(error).__name__}: {error}{where}", 500))


def _teller(theirs: connection.Connection) -> Tell:
    last = time.monotonic()

    def tell(done: float) -> None:
        nonlocal last
        if time.monotonic() - last > _OFTEN:
            last = time.monotonic()
            theirs.send(("progress", done))

    return tell


def _mortal(parent: int) -> None:
    """End when the parent does: at once where the kernel tells (Linux), else within a second."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL))

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    if os.getppid() != parent:
        os._exit(1)
    threading.Thread(target=watch, daemon=True).start()


def _quiet() -> None:
    """Neither Ctrl-C nor the terminal's streams are this process's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    os.close(nothing)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ctrl-C waits; a process started meanwhile never sees one."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
