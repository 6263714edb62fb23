"""Those who compute ranges of a plan, each by itself: processes on this machine, or a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from icmj.errors import SweepError
from icmj.work.workers import Task, Workers


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
        SweepError: if there is no such cluster, or the number of processes is not positive.
    """
    if dask is not None:
        from icmj.work.cluster import cluster

        with cluster(dask, function) as found:
            yield found
        return
    if jobs is not None and jobs < 1:
        raise SweepError(f"{jobs} processes: expected at least 1")
    with Workers(jobs or os.cpu_count() or 1) as workers:
        yield Local(workers, function)
