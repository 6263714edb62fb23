"""Workers that compute ranges of a plan: processes of this machine, which end with this one, or a Dask cluster.

Processes are started afresh on every system (MuJoCo's callbacks and numba's threads do not survive a fork). They do not
run the user's script again, so that it needs no guard, and functions that it defines itself reach them all the same.
They know nothing of Ctrl-C, which is for this process to handle, and neither write to the terminal nor hold it open.
They import nothing from the working folder that this process does not. One that dies takes only its own task with it.
Tasks go to their standard input, and messages come from their standard output, each pickled twice: what is in it may
fail to be read. docs/sweeps.md says how to start a cluster.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pickle import UnpicklingError, dumps, load, loads
from queue import SimpleQueue
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired
from threading import Thread
from traceback import extract_tb
from typing import IO, Any, Protocol

from icmj.base import compile_clock, process
from icmj.base.blas_threads import ignore_warnings, set_one_thread
from icmj.base.process import collect_garbage_seldom
from icmj.base.text import one_line
from icmj.errors import IcmjError, StudyError, SweepError, beyond_arithmetic, beyond_memory

Tell = Callable[[float], None]
_OFTEN = 0.3  # s between two messages on progress
_PATIENCE = 5.0  # s for a process to be gone
_PROGRAM, _READY = "from icmj.work.workers import serve; serve()", b"icmj is ready\n"
_POLITE = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@dataclass(frozen=True)
class Task:
    """A function to call in a worker, with ``progress`` as a further argument.

    Attributes:
        name: for people.
        function: takes ``arguments`` and ``progress``; it may be one of a script or a notebook.
        arguments: anything that can be pickled.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class Message:
    """A message of a worker: the progress of a task (0–1), or its end with the returned value, or that the worker died.

    Attributes:
        index: the task's place among the tasks.
        done: how far it is, 0–1.
        value: what it returned, once it is done.
        died: how its process ended, if it died and the other tasks go on; else empty.
    """

    index: int
    done: float
    value: Any = None
    died: str = ""


class _Worker:
    """One process, the task that it has in hand, and a thread that puts its messages into ``inbox``."""

    def __init__(self, inbox: SimpleQueue[tuple[_Worker, bytes | None]]) -> None:
        self.index: int | None = None
        self.name = ""
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
        # warnings nobody sees, and where Python was asked to raise them they would end a task
        ours = {"PYTHONPATH": paths, "PYTHONSAFEPATH": "1", "PYTHONWARNINGS": "ignore"}
        environment = {**set_one_thread({**os.environ}), **ours}
        with _hold_signals():
            self.process = Popen(
                [sys.executable, "-c", _PROGRAM], stdin=PIPE, stdout=PIPE, stderr=DEVNULL, env=environment
            )
            assert self.process.stdin is not None
            assert self.process.stdout is not None
            self._requests = self.process.stdin
            Thread(target=self._listen, args=(self.process.stdout, inbox), daemon=True).start()

    def _listen(self, stream: IO[bytes], inbox: SimpleQueue[tuple[_Worker, bytes | None]]) -> None:
        with suppress(EOFError, OSError, UnpicklingError), stream:
            while (line := stream.readline()) and not line.endswith(_READY):
                continue  # what Python prints at its start
            while True:
                inbox.put((self, load(stream)))
        inbox.put((self, None))

    def send(self, index: int, task: Task) -> None:
        from cloudpickle import dumps

        self.index, self.name = index, task.name
        with suppress(OSError):  # it is dead, which shows when its message is awaited
            _write(dumps((task.function, task.arguments)), self._requests)

    def end(self) -> None:
        compile_clock.end_compiling(self, altogether=True)
        with suppress(OSError):
            self._requests.close()  # at which it ends by itself, should it ignore the signal
        self.process.terminate()
        self.wait()

    def wait(self) -> int | None:
        """Exit status, negative for a signal; ``None`` if it is not gone in time."""
        with suppress(TimeoutExpired):
            self.process.wait(_PATIENCE)
        return self.process.returncode


def _write(message: bytes, stream: IO[bytes]) -> None:
    stream.write(dumps(message))
    stream.flush()


def processors() -> int:
    """The number of processors that this process may use: a container or a cluster may allot it but a few."""
    from loky import cpu_count

    with ignore_warnings():  # on a system that allots none, loky would ask for psutil
        return int(cpu_count())


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
        self._inbox = SimpleQueue[tuple[_Worker, bytes | None]]()

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        while self._workers:
            self._workers.pop().end()

    def run(self, tasks: Iterable[Task], *, survive: bool = False) -> Iterator[Message]:
        """Do all tasks, a few at a time in this order; yields their messages as they come.

        Args:
            tasks: taken one by one as a process is free for them, so that there may be very many.
            survive: whether the death of a process is a message about its task, and the other tasks go on.

        Raises:
            IcmjError: what a task raised, or that its process died.
        """
        source = iter(enumerate(tasks))
        following = next(source, None)
        while following is not None or any(worker.index is not None for worker in self._workers):
            while following is not None and (worker := self._find_idle()) is not None:
                worker.send(*following)
                following = next(source, None)
            worker, content = self._inbox.get()
            if worker in self._workers and (message := self._receive(worker, content, survive)) is not None:
                yield message

    def _find_idle(self) -> _Worker | None:
        """One that has nothing to do, started if there may be one more."""
        if all(worker.index is not None for worker in self._workers) and len(self._workers) < self._jobs:
            self._workers.append(_Worker(self._inbox))
        return next((worker for worker in self._workers if worker.index is None), None)

    def _receive(self, worker: _Worker, content: bytes | None, survive: bool) -> Message | None:
        """The message about its task; ``None`` if it has none, or only reports whether it compiles."""
        index = worker.index
        if content is None:
            code = worker.wait()
            self._workers.remove(worker)
            worker.end()
            why = f"signal {-code}" if code is not None and code < 0 else f"exit status {code}"
            if index is None:
                return None
            if survive:
                return Message(index, 1.0, died=why)
            raise StudyError(
                f"{worker.name}: its process died ({why}); out of memory, or MuJoCo ended it; what was finished is kept"
            )
        kind, value = loads(content)
        if kind == "compiling":
            compile_clock.begin_compiling(worker) if value else compile_clock.end_compiling(worker, altogether=True)
        if index is None or kind == "compiling":
            return None
        if kind == "progress":
            return Message(index, value)
        worker.index = None
        if kind == "error":
            raise value
        return Message(index, 1.0, value)


def serve() -> None:
    """Do one task after the other, until the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _POLITE)
    requests, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nothing, stream)
    collect_garbage_seldom()
    process.load_matplotlib_apart()
    compile_clock.listen_to_compiling(lambda begun: _write(dumps(("compiling", begun)), replies))
    tasks = SimpleQueue[bytes]()
    Thread(target=_listen, args=(requests, tasks), daemon=True).start()
    with suppress(OSError):
        replies.write(_READY)
        while True:
            _write(_perform(tasks.get(), _make_teller(replies)), replies)


def _listen(requests: IO[bytes], tasks: SimpleQueue[bytes]) -> None:
    """Receive tasks in a thread of its own, so that the end of the parent is noticed while a task is under way."""
    with suppress(EOFError, OSError, UnpicklingError):
        while True:
            tasks.put(load(requests))
    os._exit(1)


def _perform(task: bytes, tell: Tell) -> bytes:
    """Do a task; its value or its error, pickled: pickling may fail as well."""
    from cloudpickle import dumps

    found: Exception
    name = "the task"
    try:
        function, arguments = loads(task)
        name = getattr(function, "__name__", name)
        return bytes(dumps(("done", function(*arguments, progress=tell))))
    except IcmjError as error:
        found = type(error)(str(error))
    except Exception as error:
        if beyond_memory(error):
            found = StudyError(f"{name}: out of memory; run fewer jobs, or record more coarsely")
        elif beyond_arithmetic(error):
            found = StudyError(f"not computable: numbers too far apart ({one_line(error, 200)})")
        else:
            where = extract_tb(error.__traceback__)[-1]
            found = RuntimeError(one_line(f"{type(error).__name__}: {error} at {where.filename}:{where.lineno}", 500))
    return bytes(dumps(("error", found)))


def _make_teller(replies: IO[bytes]) -> Tell:
    last = time.monotonic()

    def tell(done: float) -> None:
        nonlocal last
        if time.monotonic() - last > _OFTEN:
            last = time.monotonic()
            _write(dumps(("progress", done)), replies)

    return tell


@contextmanager
def _hold_signals() -> Iterator[None]:
    """Hold signals back until a process is started and known; they stay blocked in it: Ctrl-C never reaches it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _POLITE)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_AHEAD = 2  # tasks for each thread of the cluster: one at work, one that waits
_ANSWER = 30.0  # s for the scheduler to answer, as long as Dask itself waits
_WORKERLESS = 60.0  # s without a worker; a queue of a cluster may take as long to start one
_GLANCE, _ASK = 0.02, 0.5  # s between two looks at what has come, and between two questions to the scheduler
_FAREWELL = 2.0  # s for it to hear that it is no longer needed


class Cluster:
    """A scheduler and its workers, who compute by a function of a plan and a range."""

    def __init__(self, client: Any, function: Callable[..., Any]) -> None:
        self._client, self._function = client, function

    def compute(self, plan: Any, ranges: Iterator[range]) -> Iterator[tuple[range, Any, str]]:
        """Ranges of a plan, and what came of each as it comes; ``None``, and why, where it killed its workers.

        Raises:
            SweepError: if the scheduler is gone.
        """
        from dask.distributed import as_completed

        under_way: dict[str, range] = {}

        def submit(points: range) -> Any:
            # the plan goes with every task: data that is scattered is lost with the worker that holds it
            future = self._client.submit(self._function, plan, points, pure=False)
            under_way[future.key] = points
            return future

        with self._there():
            queue: Any = as_completed([submit(points) for points in islice(ranges, self._room())])
        while under_way:
            with self._there():
                self._await(queue)
                future = next(queue)
                points = under_way.pop(future.key)
                computed, why = _outcome(future)
                del future  # or the scheduler would keep what came of it
                while len(under_way) < self._room() and (following := next(ranges, None)) is not None:
                    queue.add(submit(following))
            yield points, computed, why

    @contextmanager
    def _there(self) -> Iterator[None]:
        """Within the block the scheduler is there; without it everything is cancelled, or fails somehow.

        Raises:
            SweepError: if it is gone.
        """
        why, gone = "", False
        try:
            yield
        except SweepError as error:
            why = str(error)
        except Exception as error:
            why = one_line(f"{type(error).__name__}: {error}", 200)
            gone = _is_closed(error)
            if self._client.status == "running" and not gone:
                raise SweepError(f"the cluster cannot be asked to compute ({why})") from error
        if self._client.status != "running" or gone:
            raise SweepError("the scheduler of the cluster no longer answers; finished results are kept")
        if why:
            raise SweepError(why)

    def _await(self, queue: Any) -> None:
        """Wait until something of ``queue`` has come, while the scheduler has workers.

        Raises:
            SweepError: if it has none for so long that no more are expected.
        """
        since = asked = time.monotonic()
        while not queue.has_ready():
            time.sleep(_GLANCE)
            if (now := time.monotonic()) < asked + _ASK:
                continue
            asked = now
            if self._client.nthreads():
                since = now
            elif now - since > _WORKERLESS:
                raise SweepError(
                    f"the scheduler has had no workers for {_WORKERLESS:g} s; start some, as dask worker ADDRESS does"
                )

    def _room(self) -> int:
        return _AHEAD * max(1, sum(self._client.nthreads().values()))


@contextmanager
def cluster(address: str, function: Callable[..., Any]) -> Iterator[Cluster]:
    """A cluster by the address of its scheduler, whose workers are to compute by ``function``.

    Raises:
        SweepError: if dask is not installed, or no scheduler answers.
    """
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise SweepError(f"--dask {address}: needs dask; in a checkout: pip install -e '.[dask]'") from error
    with _unsaid():
        try:
            client = Client(address, timeout=_ANSWER)
        except (OSError, ValueError, TimeoutError) as error:
            raise SweepError(f"--dask {address}: no scheduler answers there ({one_line(error, 200)})") from error
        try:
            yield Cluster(client, function)
        finally:
            with suppress(Exception):  # the scheduler is gone
                client.close(timeout=_FAREWELL)


@contextmanager
def _unsaid() -> Iterator[None]:
    """Within the block the cluster's libraries log nothing: what it means comes as an error."""
    known = [name for name in logging.root.manager.loggerDict if name.startswith(("distributed.", "tornado."))]
    every = [logging.getLogger(name) for name in ("distributed", "asyncio", "tornado", *known)]
    before = [logger.disabled for logger in every]
    for logger in every:
        logger.disabled = True
    try:
        yield
    finally:
        for logger, was in zip(every, before, strict=True):
            logger.disabled = was


def _is_closed(error: Exception) -> bool:
    """Whether the connection to the scheduler is closed, which is known before the client's status says so."""
    return isinstance(error, ConnectionError) or type(error).__name__ == "CommClosedError"


def _outcome(future: Any) -> tuple[Any, str]:
    from concurrent.futures import CancelledError

    from dask.distributed import KilledWorker

    try:
        return future.result(), ""
    except (KilledWorker, CancelledError) as error:
        return None, one_line(error, 200)
    except Exception as error:
        if _is_closed(error):  # what came of it was not fetched
            raise
        # of a worker that cannot compute at all: no icmj, other versions
        raise SweepError(
            f"a worker of the cluster cannot compute ({one_line(f'{type(error).__name__}: {error}', 300)})"
        ) from error


def do(tasks: Sequence[Task], jobs: int) -> Iterator[Message]:
    """Do all tasks in so many processes, or one after the other in this one if ``jobs`` is 1; yields their messages.

    Raises:
        IcmjError: what a task raised, or that its process died.
    """
    if jobs > 1:
        with Workers(jobs) as workers:
            yield from workers.run(tasks)
        return
    for index, task in enumerate(tasks):
        yield Message(index, 1.0, task.function(*task.arguments))


class Crew(Protocol):
    """The interface of processes that compute a function ``(plan, range)``."""

    def compute(self, plan: Any, ranges: Iterator[range]) -> Iterator[tuple[range, Any, str]]:
        """Ranges of a plan with their results as they arrive; ``None`` with the reason if the process died."""


class Local:
    """Processes on this machine."""

    def __init__(self, workers: Workers, function: Callable[..., Any]) -> None:
        self._workers, self._function = workers, function

    def compute(self, plan: Any, ranges: Iterator[range]) -> Iterator[tuple[range, Any, str]]:
        """See :class:`Crew`."""
        given: dict[int, range] = {}

        def tasks() -> Iterator[Task]:
            for i, points in enumerate(ranges):
                given[i] = points
                yield Task(f"points {points.start} to {points.stop - 1}", self._function, (plan, points))

        for news in self._workers.run(tasks(), survive=True):
            if news.done >= 1.0 and (news.died or news.value is not None):
                yield given.pop(news.index), news.value, news.died


@contextmanager
def crew(function: Callable[..., Any], jobs: int | None = None, dask: str | None = None) -> Iterator[Crew]:
    """The processes that compute ``function(plan, range)``; on this machine, it also receives ``progress``.

    Args:
        function: importable by name.
        jobs: number of local processes; by default the number of cores.
        dask: address of a Dask scheduler, whose workers are used instead.

    Raises:
        SweepError: if there is no such cluster.
        StudyError: if the number of processes is not positive.
    """
    if dask is not None:
        with cluster(dask, function) as found:
            yield found
        return
    with Workers(processes(jobs)) as workers:
        yield Local(workers, function)
