"""Progress: how often a line comes, the time that remains, and the line of a terminal that changes in place."""

import io
import re
import time
from collections.abc import Iterator

import pytest
from patience import PATIENCE

from icmj.base import compile_clock
from icmj.cli import progress
from icmj.cli.terminal import Terminal


class Clock:
    """Seconds that pass when a test says so."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Clock]:
    clock = Clock()
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(compile_clock, "time", clock)
    return clock


def test_lines_come_less_and_less_often(clock: Clock) -> None:
    """The first command had 22 lines in a minute, and 120 in ten."""
    console = Terminal(file=io.StringIO())
    console.began = clock.now
    times = []
    for _ in range(11):
        due = progress.Working("study", console)._find_due()  # each work of a command goes on where the one before left
        clock.now = console.progressed = due
        times.append(due - 1000)
    assert times == [2, 7, 14, 28, 56, 112, 224, 448, 896, 1496, 2096]


def test_what_remains_is_in_proportion_to_the_work(clock: Clock) -> None:
    remaining = progress.Remaining()
    clock.now += 3  # libraries are imported
    remaining.note(0.2)  # of it most was there from before
    assert remaining.say() == ""
    for done in (0.25, 0.3, 0.35):
        clock.now += 4
        remaining.note(done)
    # 0.15 in 12 s
    assert remaining.estimate() == pytest.approx(52)
    clock.now += 5
    assert remaining.estimate() == pytest.approx(47)
    assert remaining.say() == "about 45 s left"
    clock.now += 60  # it took longer: nothing is known
    assert remaining.say() == ""
    remaining.note(0.4)
    assert remaining.estimate() == pytest.approx(0.6 * 77 / 0.2)
    assert remaining.say() == "about 3.8 min left"
    remaining.note(0.1)  # other work
    assert remaining.say() == ""
    clock.now += 3
    remaining.note(0.7)
    assert remaining.say() == "about 2 s left"


def test_a_few_seconds_and_a_small_part_tell_nothing(clock: Clock) -> None:
    remaining = progress.Remaining()
    remaining.note(0.0)
    clock.now += 5
    remaining.note(0.02)
    assert remaining.estimate() is None
    clock.now += 30
    remaining.note(0.025)  # but half a minute does
    assert remaining.estimate() == pytest.approx(35 * 0.975 / 0.025)
    assert remaining.say() == "about 23 min left"


def test_compiling_is_no_work(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_clock, "USUAL", compile_clock.read_compile_time() + 10)
    remaining = progress.Remaining()
    remaining.note(0.0)
    clock.now += 4
    remaining.note(0.1)
    compile_clock.begin_compiling()
    clock.now += 7
    assert remaining.estimate() == pytest.approx(36 + 3)
    assert progress._say_compilation() == "compiling (first run only, about 3 s)"
    clock.now += 20
    assert progress._say_compilation() == "compiling (first run only)"
    compile_clock.end_compiling()
    assert progress._say_compilation() == ""
    clock.now += 4
    remaining.note(0.2)
    assert remaining.estimate() == pytest.approx(32)


class Screen(Terminal):
    """A terminal of some width, whose output is read."""

    def __init__(self, width: int) -> None:
        super().__init__(file=io.StringIO(), force_terminal=True, width=width, height=24, legacy_windows=False)


@pytest.mark.parametrize("width", [40, 80, 200])
def test_a_terminal_has_one_line_that_changes_in_place(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "FIRST", 0.0)
    screen = Screen(width)
    monkeypatch.setattr(progress.Remaining, "say", lambda self: "about 3.8 min left")
    with progress.Working("three-link-0.9-delay (mujoco)", screen) as shown:
        deadline = time.monotonic() + PATIENCE
        for part in range(4):
            shown.tell("three-link-0.9-delay (mujoco), trial 117 of 400", part / 10)
            seen = len(screen.file.getvalue())
            while len(screen.file.getvalue()) == seen and time.monotonic() < deadline:
                time.sleep(0.02)
    text = screen.file.getvalue()
    assert text.count("\r") >= 4
    plain = re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", text)
    assert all(len(line) <= width for line in re.split(r"[\r\n]", plain))
    assert plain.count("\n") == 1  # at the end, and then the line is erased
    assert text.endswith("\x1b[1A\x1b[2K")
    assert "three-link" in plain
