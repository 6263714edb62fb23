"""A request to end unwinds, is not lost in foreign code, and leaves the handlers as they were."""

import contextlib
import os
import signal
import time
from collections.abc import Callable

import pytest

from icmj.base.interruption import EndRequest, Termination, catch_termination, interrupt_once


def sent(signum: int) -> None:
    """Signal ourselves, and wait to be ended."""
    os.kill(os.getpid(), signum)
    time.sleep(5)


def within(work: Callable[[], object]) -> EndRequest:
    with catch_termination() as asked:
        try:
            work()
        except KeyboardInterrupt:
            return asked
    raise AssertionError("it was not ended")


def ended_by(work: Callable[[], object]) -> int:
    """Status with which ``work`` is ended."""
    with pytest.raises(Termination) as caught:
        within(work)
    return caught.value.status


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGHUP])
def test_it_unwinds_and_puts_the_handlers_back(signum: int) -> None:
    watched = (signum, signal.SIGINT, signal.SIGALRM)
    before = [signal.getsignal(each) for each in watched]
    assert ended_by(lambda: sent(signum)) == 128 + signum
    assert [signal.getsignal(each) for each in watched] == before


def swallowed(signum: int) -> None:
    with contextlib.suppress(BaseException):  # as foreign code does
        sent(signum)
    time.sleep(5)


def test_one_that_is_swallowed_comes_again_and_ctrl_c_is_remembered() -> None:
    assert ended_by(lambda: swallowed(signal.SIGTERM)) == 143
    assert within(lambda: swallowed(signal.SIGINT)).signum == signal.SIGINT
    assert within(lambda: sent(signal.SIGINT)).signum == signal.SIGINT


def test_ctrl_c_is_heard_once_where_it_keeps_what_there_is() -> None:
    handler = signal.getsignal(signal.SIGINT)
    with catch_termination() as asked:
        with interrupt_once(), contextlib.suppress(KeyboardInterrupt):
            sent(signal.SIGINT)
        time.sleep(1.2)
    assert asked.signum == signal.SIGINT
    assert signal.getsignal(signal.SIGINT) is handler


def test_a_second_one_is_caught_by_nothing_that_keeps_anything() -> None:
    def work() -> None:
        with interrupt_once():
            for _ in range(3):
                with contextlib.suppress(KeyboardInterrupt):
                    sent(signal.SIGINT)

    assert ended_by(work) == 130


def test_ctrl_c_waits_for_what_must_be_whole() -> None:
    done = []

    def work() -> None:
        with interrupt_once() as heard, heard.postpone():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
            done.append(1)

    assert within(work).signum == 0
    assert done == [1]


def test_one_that_falls_into_a_destructor_comes_again(capfd: pytest.CaptureFixture[str]) -> None:
    class Slow:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.01)

    def work() -> None:
        Slow()
        time.sleep(5)

    assert ended_by(work) == 143
    assert capfd.readouterr().err == ""


def test_somebody_else_s_alarm_is_neither_rung_nor_silenced() -> None:
    rung: list[int] = []
    before = signal.signal(signal.SIGALRM, lambda signum, _: rung.append(signum))
    try:
        with catch_termination():
            with contextlib.suppress(KeyboardInterrupt):
                sent(signal.SIGINT)
            time.sleep(1.2)
            assert rung == []
            signal.setitimer(signal.ITIMER_REAL, 0.5)
            with interrupt_once(), contextlib.suppress(KeyboardInterrupt):
                sent(signal.SIGINT)
            time.sleep(0.6)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert rung == [signal.SIGALRM]  # nor is it silenced


def test_what_somebody_else_handles_stays_theirs() -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda signum, _: seen.append(signum))
    try:
        with catch_termination():
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert seen == [signal.SIGTERM]
