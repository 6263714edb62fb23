"""Requests to end, by Ctrl-C or a signal, after which nothing is left half done.

A signal that terminates unwinds the current work like Ctrl-C, so that no files are left behind. Ctrl-C may be taken
once, or be put off to the end of what belongs together.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

_POLITE = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
_ALARM = getattr(signal, "SIGALRM", None)  # not everywhere; where it is not, or somebody's, nothing is said twice
_AGAIN = 1.0  # s


class Termination(BaseException):
    """The process was asked to end.

    Attributes:
        status: exit status, 128 and the number of the signal.
    """

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.status = 128 + signum


@dataclass
class EndRequest:
    """Whether, and by which signal, the process was asked to end; 0 if it was not."""

    signum: int = 0


@contextmanager
def catch_termination() -> Iterator[EndRequest]:
    """Within the block SIGTERM and SIGHUP raise :class:`Termination`, unless they are ignored or have a handler.

    Code in other languages may turn an exception that falls into it into another one, or lose it. So what is yielded
    remembers, and the exception is raised again every second until the block is left. So is KeyboardInterrupt, but
    for what is :func:`interrupt_once`. Signals reach the main thread only; in another thread the block changes nothing.
    """
    asked = EndRequest()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    before: dict[int, Any] = {}

    def ring(after: float, again: float) -> None:
        if _ALARM in before:
            signal.setitimer(signal.ITIMER_REAL, after, again)

    def stop(signum: int, _: object) -> None:
        if signum != _ALARM:
            asked.signum = signum
            ring(_AGAIN, _AGAIN)
        if asked.signum == signal.SIGINT:
            raise KeyboardInterrupt
        raise Termination(asked.signum)

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        if lost.exc_type in (Termination, KeyboardInterrupt):  # it fell into a destructor, which cannot end anything
            ring(0.01, signal.getitimer(signal.ITIMER_REAL)[1] if _ALARM in before else 0.0)
        else:
            hook(lost)

    for signum in (*_POLITE, *([_ALARM] if _ALARM else [])):
        if signal.getsignal(signum) is signal.SIG_DFL:
            before[signum] = signal.signal(signum, stop)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, stop)
    hook = sys.unraisablehook
    sys.unraisablehook = unraisable
    try:
        yield asked
    finally:
        sys.unraisablehook = hook
        ring(0.0, 0.0)
        for signum, handler in before.items():
            signal.signal(signum, handler)


@dataclass
class Interrupt:
    """Ctrl-C within :func:`interrupt_once`."""

    count: int = 0
    waits: bool = False

    @contextmanager
    def postpone(self) -> Iterator[None]:
        """Within the block the first Ctrl-C waits until its end."""
        before, self.waits = self.count, True
        try:
            yield
        finally:
            self.waits = False
        if before == 0 and self.count:
            raise KeyboardInterrupt


@contextmanager
def defer_interrupt() -> Iterator[None]:
    """Defer Ctrl-C to the end of the block, which is short, so that related changes are made together.

    In another thread than the main one it changes nothing.
    """
    before, late = signal.getsignal(signal.SIGINT), list[tuple[int, FrameType | None]]()
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    signal.signal(signal.SIGINT, lambda signum, frame: late.append((signum, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if late:
        before(*late[-1])


@contextmanager
def interrupt_once() -> Iterator[Interrupt]:
    """Within the block Ctrl-C raises KeyboardInterrupt once; the code that catches it keeps its results and goes on.

    A second one raises :class:`Termination`, which nothing catches that keeps anything. Without a
    :func:`catch_termination` around it, or in another thread than the main one, it changes nothing.
    """
    before, heard = signal.getsignal(signal.SIGINT), Interrupt()
    bare = not callable(before) or before is signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or bare:
        yield heard
        return
    handler: Callable[[int, FrameType | None], Any] = before  # type: ignore[assignment]

    def once(signum: int, frame: FrameType | None) -> None:
        heard.count += 1
        if heard.count > 1:
            raise Termination(signum)
        if heard.waits:
            return
        try:
            handler(signum, frame)
        finally:
            if _ALARM and signal.getsignal(_ALARM) is handler:  # not somebody else's
                signal.setitimer(signal.ITIMER_REAL, 0)

    signal.signal(signal.SIGINT, once)
    try:
        yield heard
    finally:
        signal.signal(signal.SIGINT, before)
