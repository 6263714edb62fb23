"""Processes that do tasks: their values, progress and errors come back, and their death is one line."""

from __future__ import annotations

import os
import signal
import time

import pytest

from icmj.errors import StudyError
from icmj.work.workers import Task, Workers, processors


def run(*tasks: Task, jobs: int = 2) -> list[object]:
    values: dict[int, object] = {}
    with Workers(jobs) as workers:
        for news in workers.run(tasks):
            if news.done == 1.0:
                values[news.index] = news.value
    return [values[i] for i in range(len(tasks))]


# tasks are found by name in another process, which knows nothing of tests; these are of the standard library
def python(program: str) -> Task:
    return Task(program, _python, (program,))


class _Python:
    """Pickles as a function that runs a program, wherever it is read."""

    __name__ = "python"

    def __reduce__(self) -> tuple[object, ...]:
        return eval, ("lambda program, progress: exec(program, {'progress': progress}) or 'done'",)

    def __call__(self, program: str, progress: object) -> str:
        raise NotImplementedError


_python = _Python()


def test_values_come_back_by_task() -> None:
    assert run(*[python("pass")] * 5) == ["done"] * 5


def test_the_first_error_is_raised_as_it_is() -> None:
    with pytest.raises(StudyError, match="no good"):
        run(python("from icmj.errors import StudyError; raise StudyError('no good')"), python("pass"))
    with pytest.raises(RuntimeError, match="KeyError: 'x' at <string>:1"):
        run(python("{}['x']"))


def test_one_that_dies_is_named_and_the_others_are_gone() -> None:
    with pytest.raises(StudyError, match=r"its process died \(signal 9\)"):
        run(python("import time; time.sleep(60)"), python("import os; os.kill(os.getpid(), 9)"))
    with pytest.raises(StudyError, match=r"its process died \(exit status 3\)"):
        run(python("import os; os._exit(3)"))


def test_they_are_deaf_to_ctrl_c_and_have_no_terminal() -> None:
    said = (
        "import os, signal; assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN; "
        "assert all(os.readlink(f'/proc/self/fd/{i}') == '/dev/null' for i in range(3))"
    )
    assert run(python(said)) == ["done"]


def test_progress_is_told() -> None:
    told = []
    with Workers(1) as workers:
        for news in workers.run([python("import time; time.sleep(0.4); progress(0.5)")]):
            told.append(news.done)
    assert told == [0.5, 1.0]


def test_leaving_ends_them() -> None:
    with Workers(1) as workers:
        news = workers.run([python("import time; time.sleep(0.4); progress(0.5); time.sleep(60)")])
        next(news)
        (pid,) = (worker.process.pid for worker in workers._workers)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    time.sleep(0)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system allots no processors to a process")
def test_as_many_as_this_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a machine's many, a container or a cluster allots it a few."""
    allotted = os.sched_getaffinity(0)
    assert processors() == len(allotted)
    try:
        os.sched_setaffinity(0, {min(allotted)})
        assert processors() == 1
    finally:
        os.sched_setaffinity(0, allotted)
    monkeypatch.delattr(os, "sched_getaffinity")
    assert processors() == (os.cpu_count() or 1)
