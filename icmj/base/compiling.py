"""Whether something is compiled for the first time, in this process or in one that works for it.

Compiling takes ten to twenty seconds after installation. Whoever shows what is under way asks :func:`compiling`; a
worker process passes on what it hears by :func:`listen`.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable

_under_way: dict[Hashable, int] = {}
_listeners: list[Callable[[bool], None]] = []


def compiling() -> bool:
    """Whether something is being compiled now."""
    return bool(_under_way)


def begin(who: Hashable = "here") -> None:
    """``who`` compiles; every beginning needs its :func:`end`."""
    _under_way[who] = _under_way.get(who, 0) + 1
    _tell()


def end(who: Hashable = "here", *, altogether: bool = False) -> None:
    """``who`` has finished compiling once, or does not compile any more at all."""
    left = 0 if altogether else _under_way.get(who, 0) - 1
    if left > 0:
        _under_way[who] = left
    else:
        _under_way.pop(who, None)
    _tell()


def listen(listener: Callable[[bool], None]) -> None:
    """Call ``listener`` with :func:`compiling` whenever something begins or ends."""
    _listeners.append(listener)


def _tell() -> None:
    for listener in _listeners:
        listener(compiling())
