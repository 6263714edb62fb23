"""Those who compute ranges of a plan, each by itself: processes on this machine, or a Dask cluster.

See docs/sweeps.md for how to start a cluster.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from typing import Any, Protocol

from icmj.base.text import one_line
from icmj.errors import SweepError
from icmj.work.workers import Task, Workers, processes

_AHEAD = 2  # tasks for each thread of the cluster: one at work, one that waits
_PATIENCE = 30.0  # s for the scheduler to answer, as long as Dask itself waits
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
            gone = _closed(error)
            if self._client.status == "running" and not gone:
                raise SweepError(f"the cluster cannot be asked to compute ({why})") from error
        if self._client.status != "running" or gone:
            raise SweepError("the scheduler of the cluster no longer answers; finished results are kept")
        if why:
            raise SweepError(why)

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
        raise SweepError(f"--dask {address}: needs dask; install it with pip install 'icmj[dask]'") from error
    with _unsaid():
        try:
            client = Client(address, timeout=_PATIENCE)
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


def _closed(error: Exception) -> bool:
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
        if _closed(error):  # what came of it was not fetched
            raise
        # of a worker that cannot compute at all: no icmj, other versions
        raise SweepError(
            f"a worker of the cluster cannot compute: {one_line(f'{type(error).__name__}: {error}', 300)}"
        ) from error


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
