"""That something is compiled is known to whoever shows what is under way, also of processes that work for this one."""

from __future__ import annotations

import io
import re
import time

import pytest
from patience import PATIENCE

from icmj.base import compiling
from icmj.cli import working
from icmj.cli.terminal import Terminal
from icmj.work.workers import Task, Workers


def compile_for(seconds: float, progress: object) -> bool:
    """A task that seems to compile."""
    compiling.begin()
    time.sleep(seconds)
    compiling.end()
    return compiling.compiling()


def test_what_begins_and_ends_is_counted() -> None:
    heard: list[bool] = []
    compiling.listen(heard.append)
    try:
        compiling.begin()
        compiling.begin()  # one function compiles what it calls
        compiling.end()
        assert compiling.compiling()
        compiling.end()
        compiling.begin("another")
        compiling.end("another", altogether=True)
        assert heard == [True, True, True, False, True, False]
    finally:
        compiling._listeners.remove(heard.append)
    assert not compiling.compiling()


def test_a_worker_that_compiles_is_known_here() -> None:
    seen: list[bool] = []
    compiling.listen(seen.append)
    try:
        with Workers(1) as workers:
            (news,) = workers.run([Task("task", compile_for, (0.1,))])
    finally:
        compiling._listeners.remove(seen.append)
    assert news.value is False
    assert seen[:2] == [True, False]
    assert not compiling.compiling()


def test_the_time_that_is_spent_on_it_is_measured_once_for_all_who_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(compiling.time, "monotonic", lambda: now[0])
    before = compiling.spent()
    for seconds, what, who in ((1, compiling.begin, "one"), (2, compiling.begin, "two"), (4, compiling.end, "one")):
        now[0] += seconds
        what(who)
    now[0] += 8
    assert compiling.spent() - before == 2 + 4 + 8
    compiling.end("two", altogether=True)
    now[0] += 16
    assert compiling.spent() - before == 2 + 4 + 8


def test_it_is_said_with_the_time_that_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was "17 % after 5 s … 17 % after 35 s"."""
    monkeypatch.setattr(working, "FIRST", 0.05)
    monkeypatch.setattr(compiling, "USUAL", compiling.spent() + 7.2)
    file = io.StringIO()
    with working.Working("study", Terminal(file=file)) as shown:
        shown.tell("simple-0.8", 0.17)
        compiling.begin()
        deadline = time.monotonic() + PATIENCE
        while not file.getvalue().endswith("\n") and time.monotonic() < deadline:
            time.sleep(0.02)
        compiling.end()
    words = r"icmj: simple-0.8, 17 %, compiling \(first run only, about \d s\), after \d+ s\n"
    assert re.fullmatch(words, file.getvalue())
