"""MuJoCo's callbacks, installed for the length of a ``with`` block and always removed.

The engine has one control and one activation callback for the whole process. Blocks in different threads that want
the same pair share it, and it stays until the last of them is left; a block that wants another pair waits until
the other threads have left theirs. Within one thread blocks nest, and the inner one wins.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import mujoco

from icmj.engine.hush import hushed

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
