"""What MuJoCo has once for the process, set for a ``with`` block and always restored: its callbacks and its messages.

The engine has one control and one activation callback for the whole process. Blocks in different threads that want
the same pair share it, and it stays until the last of them is left; a block that wants another pair waits until
the other threads have left theirs. Within one thread blocks nest, and the inner one wins.

MuJoCo prints its warnings and appends them to MUJOCO_LOG.TXT wherever it is run. What they say comes back as the
outcome of a run, or as an error. Outside the blocks, MuJoCo does for others what it always did.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import mujoco

_lock = threading.Lock()
_inside = 0
_before: tuple[Any, Any] = (True, True)


@contextmanager
def hushed() -> Iterator[None]:
    """No message of MuJoCo on the console or in a file; blocks nest, in any number of threads."""
    global _inside, _before
    with _lock:
        if _inside == 0:
            _before = _set(False, False)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _set(*_before)


def _set(console: bool, file: bool) -> tuple[Any, Any]:
    """Set the message handlers and return the previous ones."""
    config = mujoco.MjLogConfig.get()
    before = config.logto_console, config.logto_file
    config.logto_console, config.logto_file = console, file
    config.set()
    return before


# a Python function, or a native one as a ctypes function object
ControlCallback = Callable[..., None]
ActDynCallback = Callable[..., float]


@dataclass(eq=False)
class _Layer:
    """One installed pair, the pair that it replaced, and the threads inside its blocks (one entry for each block)."""

    pair: tuple[Any, Any]
    before: tuple[Any, Any]
    threads: list[int] = field(default_factory=list)


_layers: list[_Layer] = []
_changed = threading.Condition()


@contextmanager
def installed(control: ControlCallback | None = None, act_dyn: ActDynCallback | None = None) -> Iterator[None]:
    """Install MuJoCo's control and activation callbacks, and always restore the previous ones on leaving.

    MuJoCo prints nothing meanwhile. Load no model inside the block: an installed Python callback breaks the compiler.
    Python callbacks are called by every thread that steps a model meanwhile, so guard them by the model, as those of
    this package are.
    """
    pair, me = (control, act_dyn), threading.get_ident()
    with _changed:
        _changed.wait_for(lambda: _shared(pair) or _mine(me))
        if not _shared(pair):
            _layers.append(_Layer(pair, _install(pair)))
        layer = _layers[-1]
        layer.threads.append(me)
    try:
        with hushed():
            yield
    finally:
        with _changed:
            layer.threads.remove(me)
            while _layers and not _layers[-1].threads:
                _install(_layers.pop().before)
            _changed.notify_all()


def _shared(pair: tuple[Any, Any]) -> bool:
    return bool(_layers) and all(a is b for a, b in zip(_layers[-1].pair, pair, strict=True))


def _mine(me: int) -> bool:
    return all(thread == me for layer in _layers for thread in layer.threads)


def _install(pair: tuple[Any, Any]) -> tuple[Any, Any]:
    """Install a pair and return the one that it replaced."""
    before = mujoco.get_mjcb_control(), mujoco.get_mjcb_act_dyn()
    mujoco.set_mjcb_control(pair[0])
    try:
        mujoco.set_mjcb_act_dyn(pair[1])
    except BaseException:
        mujoco.set_mjcb_control(before[0])
        raise
    return before
