"""Processes that do tasks: their values, progress and errors come back, and their death is one line."""

import builtins
import io
import os
import signal
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import pytest
from patience import PATIENCE

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


def _lock(progress: object) -> object:
    """What is of this process alone."""
    return threading.Lock()


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


def test_one_that_dies_takes_only_its_own_task_with_it() -> None:
    """Also one that ends as if all were well."""
    ends = {"import os; os.kill(os.getpid(), 9)": "signal 9", "import os; os._exit(0)": "exit status 0"}
    with Workers(2) as workers:
        news = [*workers.run([*map(python, ends), *[python("pass")] * 4], survive=True)]
    assert {one.index: one.died for one in news if one.died} == dict(enumerate(ends.values()))
    assert sorted(one.index for one in news if one.value == "done") == [2, 3, 4, 5]


def test_what_cannot_be_sent_back_is_an_error() -> None:
    with pytest.raises(RuntimeError, match="pickle"):
        run(Task("lock", _lock, ()))


def test_a_script_without_a_guard_is_not_run_again_and_its_own_functions_reach_them(tmp_path: Path) -> None:
    """As the script in docs/sweeps.md, and one in a notebook: it was "Can't pickle", or a process that died."""
    script = tmp_path / "script.py"
    script.write_text(
        "from icmj.work.workers import Task, Workers\n"
        "print('begun')\n"
        "def twice(x, progress):\n"
        "    return offset + 2 * x\n"
        "offset = 1\n"
        "with Workers(2) as workers:\n"
        "    news = [*workers.run([Task('a', twice, (i,)) for i in range(3)])]\n"
        "    news += workers.run([Task('b', lambda x, progress: -x, (1,))])\n"
        "print(sorted(one.value for one in news))\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    how = {"capture_output": True, "text": True, "timeout": PATIENCE}
    done = subprocess.run([sys.executable, script], **how, env=environment, cwd=tmp_path)
    assert done.stdout == "begun\n[-1, 1, 3, 5]\n", done.stderr
    assert done.stderr == ""


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


def test_a_quota_of_processors_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two processors' worth of 64, as ``docker run --cpus 2`` gives; there were 64 processes."""
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(64)))
    quota = {"/sys/fs/cgroup/cpu.max": "200000 100000\n"}
    exists, read = os.path.exists, builtins.open
    monkeypatch.setattr(os.path, "exists", lambda path: path in quota or exists(path))
    monkeypatch.setattr(
        builtins,
        "open",
        lambda path, *more, **named: io.StringIO(quota[path]) if path in quota else read(path, *more, **named),
    )
    assert processors() == 2


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
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert 1 <= processors() <= (os.cpu_count() or 1)


def test_a_daemonic_process_may_start_them(tmp_path: Path) -> None:
    """Such as one of a pool of multiprocessing: it was refused."""
    script = tmp_path / "script.py"
    script.write_text(
        "from multiprocessing import current_process, get_context\n"
        "from icmj.work.workers import Task, Workers\n"
        "def ask(x):\n"
        "    with Workers(1) as workers:\n"
        "        tasks = [Task('seven', '7'.format, ())]\n"
        "        return current_process().daemon, [news.value for news in workers.run(tasks)]\n"
        "if __name__ == '__main__':\n"
        "    with get_context('spawn').Pool(1) as pool:\n"
        "        print(pool.map(ask, [0]))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=PATIENCE, cwd=tmp_path)
    assert done.stdout == "[(True, ['7'])]\n", done.stderr


def test_what_python_prints_at_its_start_is_no_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sitecustomize.py").write_text("print('hello')\nprint('without an end', end='')\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert run(python("print('more'); import os; os.write(1, b'and more')")) == ["done"]


def test_one_that_dies_before_it_is_ready_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sitecustomize.py").write_text("import os; os._exit(7)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(StudyError, match=r"its process died \(exit status 7\)"):
        run(python("pass"))


def test_messages_may_be_large() -> None:
    size = 3 * 2**20

    def count(data: bytes, progress: object) -> bytes:
        return data + b"x"

    assert [len(value) for value in run(*[Task("count", count, (bytes(size),))] * 3)] == [size + 1] * 3


def test_nothing_in_the_working_folder_is_imported_by_them_or_their_helpers(tmp_path: Path) -> None:
    """A ``copy.py`` of one's own ended them with status 70, and any other module there was run."""
    marks = tmp_path / "marks"
    work, script = tmp_path / "work", tmp_path / "script" / "icmj"
    for folder in (work, script.parent):
        folder.mkdir()
    for name in sys.stdlib_module_names | {"loky", "cloudpickle", "numpy", "icmj", "sitecustomize", "usercustomize"}:
        (work / f"{name}.py").write_text(f"open({str(marks)!r}, 'a').write({name!r} + chr(10))")
    script.write_text(
        "import os, sys\n"
        "from icmj.work.workers import Task, Workers\n"
        "before = dict(os.environ)\n"
        "with Workers(2) as workers:\n"
        "    news = [*workers.run([Task('sys.path', lambda progress: __import__('sys').path, ()) for _ in range(2)])]\n"
        "print(dict(os.environ) == before, *(os.getcwd() in one.value for one in news))\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    how = {"capture_output": True, "text": True, "timeout": PATIENCE}
    done = subprocess.run([sys.executable, script], **how, env=environment, cwd=work)
    assert done.stdout == "True False False\n", done.stderr
    assert not marks.exists(), marks.read_text()


def test_what_a_worker_needs_from_a_script_s_own_folder_it_finds(tmp_path: Path) -> None:
    """Also where that is the working folder: what Python searches for the script, it searches for the worker."""
    (tmp_path / "helper.py").write_text("def twice(x, progress):\n    return 2 * x\n")
    script = tmp_path / "script.py"
    script.write_text(
        "from helper import twice\n"
        "from icmj.work.workers import Task, Workers\n"
        "with Workers(1) as workers:\n"
        "    print(*(one.value for one in workers.run([Task('twice', twice, (2,))])))\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    how = {"capture_output": True, "text": True, "timeout": PATIENCE, "env": environment, "cwd": tmp_path}
    for command in ([script], ["-c", script.read_text()]):
        done = subprocess.run([sys.executable, *command], **how)
        assert done.stdout == "4\n", done.stderr
