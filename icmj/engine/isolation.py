"""MuJoCo without what others have set in it: callbacks and messages are icmj's within a block, and then restored.

The engine has one callback of each kind for the whole process, which it calls for every model, also while it compiles
one. What others have set is taken off before the first block is entered and put back when the last is left; in
between, the only callbacks are icmj's own, which are compiled and leave alone every model but the composed ones. So
blocks nest, and go on in any number of threads, with callbacks and without. Only where the code is interpreted are the
callbacks Python functions, which break the compiler: there a block is one thread's at a time, and the inner one wins.

MuJoCo prints its warnings and appends them to MUJOCO_LOG.TXT wherever it is run. What they say comes back as the
outcome of a run, or as an error. Outside the blocks, MuJoCo does for others what it always did.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import mujoco

from icmj.base.blas_threads import SharedBlock
from icmj.base.process import INTERPRETED
from icmj.engine.library import find_symbol


@contextmanager
def hold_engine() -> Iterator[None]:
    """MuJoCo without what others have set in it: silent, and without callbacks."""
    config = mujoco.MjLogConfig.get()
    console, file = config.logto_console, config.logto_file
    config.logto_console = config.logto_file = False
    config.set()
    callbacks = _take_callbacks()
    try:
        yield
    finally:
        _take_callbacks()
        for name, (function, address) in callbacks.items():
            getattr(mujoco, f"set_{name}")(function)
            find_symbol(name).value = address
        config.logto_console, config.logto_file = console, file
        config.set()


def _take_callbacks() -> dict[str, tuple[Any, int]]:
    """Take all of MuJoCo's callbacks off, and return those that were set, as Python and as C has them."""
    found = {}
    for name in _CALLBACKS:
        if address := find_symbol(name).value:
            found[name] = getattr(mujoco, f"get_{name}")(), address
            getattr(mujoco, f"set_{name}")(None)
            find_symbol(name).value = None  # one that C has set is nothing to Python
    return found


_CALLBACKS = [name[4:] for name in dir(mujoco) if name.startswith(("get_mjcb_", "get_mju_user_warning"))]
_shared = hold_engine if INTERPRETED else SharedBlock(hold_engine)
_turn = threading.RLock() if INTERPRETED else nullcontext()


@contextmanager
def isolate_engine(control: object = None, act_dyn: object = None) -> Iterator[None]:
    """Have MuJoCo to icmj alone: no callbacks but these two, which are always the same two, and no messages.

    Whatever compiles a model or has the engine compute does so within.
    """
    with _turn, _shared():
        if control is not None:
            mujoco.set_mjcb_control(control)
            mujoco.set_mjcb_act_dyn(act_dyn)
        yield
