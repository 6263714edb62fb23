"""Whether something is compiled for the first time, in this process or in one that works for it, and for how long.

Compiling takes about ten seconds after installation. Whoever shows what is under way asks :func:`is_compiling`, and of
the time that passes how much of it is :func:`read_compile_time` so; a worker process passes its own state on by
:func:`listen_to_compiling`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable

_under_way: dict[Hashable, int] = {}
_listeners: list[Callable[[bool], None]] = []
USUAL = 10.0  # s that a loop takes to compile on a processor that does nothing else
_since, _compiled_before = 0.0, 0.0  # when the present compilation began, and what all before it took [s]


def is_compiling() -> bool:
    """Whether something is being compiled now."""
    return bool(_under_way)


def read_compile_time() -> float:
    """Seconds since the start of this process during which something was compiled."""
    return _compiled_before + (time.monotonic() - _since if _under_way else 0.0)


def begin_compiling(who: Hashable = "here") -> None:
    """``who`` compiles; every beginning needs its :func:`end_compiling`."""
    global _since
    if not _under_way:
        _since = time.monotonic()
    _under_way[who] = _under_way.get(who, 0) + 1
    _report()


def end_compiling(who: Hashable = "here", *, altogether: bool = False) -> None:
    """``who`` has finished compiling once, or does not compile any more at all."""
    global _compiled_before
    before = read_compile_time()
    left = 0 if altogether else _under_way.get(who, 0) - 1
    if left > 0:
        _under_way[who] = left
    else:
        _under_way.pop(who, None)
    if not _under_way:
        _compiled_before = before
    _report()


def listen_to_compiling(listener: Callable[[bool], None]) -> None:
    """Call ``listener`` with :func:`is_compiling` whenever something begins or ends."""
    _listeners.append(listener)


def _report() -> None:
    for listener in _listeners:
        listener(is_compiling())
