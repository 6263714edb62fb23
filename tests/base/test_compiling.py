"""That something is compiled is known to whoever shows what is under way, also of processes that work for this one."""

import io
import re
import time

import pytest
from patience import PATIENCE

from icmj.base import process
from icmj.cli import terminal
from icmj.cli.terminal import Terminal
from icmj.work.workers import Task, Workers


def compile_for(seconds: float, progress: object) -> bool:
    """A task that seems to compile."""
    process.begin_compiling()
    time.sleep(seconds)
    process.end_compiling()
    return process.compiling()


def test_what_begins_and_ends_is_counted() -> None:
    heard: list[bool] = []
    process.listen_to_compiling(heard.append)
    try:
        process.begin_compiling()
        process.begin_compiling()  # one function compiles what it calls
        process.end_compiling()
        assert process.compiling()
        process.end_compiling()
        process.begin_compiling("another")
        process.end_compiling("another", altogether=True)
        assert heard == [True, True, True, False, True, False]
    finally:
        process._listeners.remove(heard.append)
    assert not process.compiling()


def test_a_worker_that_compiles_is_known_here() -> None:
    seen: list[bool] = []
    process.listen_to_compiling(seen.append)
    try:
        with Workers(1) as workers:
            (news,) = workers.run([Task("task", compile_for, (0.1,))])
    finally:
        process._listeners.remove(seen.append)
    assert news.value is False
    assert seen[:2] == [True, False]
    assert not process.compiling()


def test_the_time_that_is_spent_on_it_is_measured_once_for_all_who_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(process.time, "monotonic", lambda: now[0])
    before = process.spent()
    for seconds, what, who in (
        (1, process.begin_compiling, "one"),
        (2, process.begin_compiling, "two"),
        (4, process.end_compiling, "one"),
    ):
        now[0] += seconds
        what(who)
    now[0] += 8
    assert process.spent() - before == 2 + 4 + 8
    process.end_compiling("two", altogether=True)
    now[0] += 16
    assert process.spent() - before == 2 + 4 + 8


def test_it_is_said_with_the_time_that_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was "17 % after 5 s … 17 % after 35 s"."""
    monkeypatch.setattr(terminal, "FIRST", 0.05)
    monkeypatch.setattr(process, "USUAL", process.spent() + 7.2)
    file = io.StringIO()
    with terminal.Working("study", Terminal(file=file)) as shown:
        shown.tell("simple-0.8", 0.17)
        process.begin_compiling()
        deadline = time.monotonic() + PATIENCE
        while not file.getvalue().endswith("\n") and time.monotonic() < deadline:
            time.sleep(0.02)
        process.end_compiling()
    words = r"icmj: simple-0.8, 17 %, compiling \(first run only, about \d s\), after \d+ s\n"
    assert re.fullmatch(words, file.getvalue())
