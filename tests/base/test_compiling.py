"""That something is compiled is known to whoever shows what is under way, also of processes that work for this one."""

import io
import re
import time

import pytest
from patience import PATIENCE

from icmj.base import compile_clock
from icmj.cli import progress
from icmj.cli.terminal import Terminal
from icmj.work.workers import Task, Workers


def compile_for(seconds: float, progress: object) -> bool:
    """A task that seems to compile."""
    compile_clock.begin_compiling()
    time.sleep(seconds)
    compile_clock.end_compiling()
    return compile_clock.is_compiling()


def test_what_begins_and_ends_is_counted() -> None:
    heard: list[bool] = []
    compile_clock.listen_to_compiling(heard.append)
    try:
        compile_clock.begin_compiling()
        compile_clock.begin_compiling()  # one function compiles what it calls
        compile_clock.end_compiling()
        assert compile_clock.is_compiling()
        compile_clock.end_compiling()
        compile_clock.begin_compiling("another")
        compile_clock.end_compiling("another", altogether=True)
        assert heard == [True, True, True, False, True, False]
    finally:
        compile_clock._listeners.remove(heard.append)
    assert not compile_clock.is_compiling()


def test_a_worker_that_compiles_is_known_here() -> None:
    seen: list[bool] = []
    compile_clock.listen_to_compiling(seen.append)
    try:
        with Workers(1) as workers:
            (news,) = workers.run([Task("task", compile_for, (0.1,))])
    finally:
        compile_clock._listeners.remove(seen.append)
    assert news.value is False
    assert seen[:2] == [True, False]
    assert not compile_clock.is_compiling()


def test_the_time_that_is_spent_on_it_is_measured_once_for_all_who_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(compile_clock.time, "monotonic", lambda: now[0])
    before = compile_clock.read_compile_time()
    for seconds, what, who in (
        (1, compile_clock.begin_compiling, "one"),
        (2, compile_clock.begin_compiling, "two"),
        (4, compile_clock.end_compiling, "one"),
    ):
        now[0] += seconds
        what(who)
    now[0] += 8
    assert compile_clock.read_compile_time() - before == 2 + 4 + 8
    compile_clock.end_compiling("two", altogether=True)
    now[0] += 16
    assert compile_clock.read_compile_time() - before == 2 + 4 + 8


def test_it_is_said_with_the_time_that_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was "17 % after 5 s … 17 % after 35 s"."""
    monkeypatch.setattr(progress, "FIRST", 0.05)
    monkeypatch.setattr(compile_clock, "USUAL", compile_clock.read_compile_time() + 7.2)
    file = io.StringIO()
    with progress.Working("study", Terminal(file=file)) as shown:
        shown.tell("simple-0.8", 0.17)
        compile_clock.begin_compiling()
        deadline = time.monotonic() + PATIENCE
        while not file.getvalue().endswith("\n") and time.monotonic() < deadline:
            time.sleep(0.02)
        compile_clock.end_compiling()
    words = r"icmj: simple-0.8, 17 %, compiling \(first run only, about \d s\), after \d+ s\n"
    assert re.fullmatch(words, file.getvalue())
