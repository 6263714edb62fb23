"""A polite request to end, which unwinds what is under way as Ctrl-C does, so that nothing is left behind."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_POLITE = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


class Terminated(BaseException):
    """The process was asked to end.

    Attributes:
        status: exit status, 128 and the number of the signal.
    """

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.status = 128 + signum


@contextmanager
def terminable() -> Iterator[None]:
    """Within the block SIGTERM and SIGHUP raise :class:`Terminated`, unless they are ignored or have a handler.

    Signals reach the main thread only; in another thread the block changes nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    default = [signum for signum in _POLITE if signal.getsignal(signum) is signal.SIG_DFL]
    for signum in default:
        signal.signal(signum, _stop)
    try:
        yield
    finally:
        for signum in default:
            signal.signal(signum, signal.SIG_DFL)


def _stop(signum: int, _: object) -> None:
    raise Terminated(signum)
