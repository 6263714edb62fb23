"""Suppress MuJoCo's messages on the terminal and in the current folder within a ``with`` block.

MuJoCo prints its warnings and appends them to MUJOCO_LOG.TXT wherever it is run. What they say comes back as the
outcome of a run, or as an error. Outside the blocks, MuJoCo does for others what it always did.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
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
