"""MuJoCo's fatal errors, caught where compiled code calls the engine.

``mju_error`` must not return, and by default ends the process: too little arena memory for the contacts of a step is
enough. Python's bindings jump out of the call; compiled code cannot. So a call that may end so is made in a thread of
its own, which is parked for good where it fails, and the one who waits for it hears of the error. That costs a tenth
of a millisecond, so it is done only for models that can fail so: with constraints, or with hardly any memory.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

import mujoco

from icmj.base.text import one_line
from icmj.engine.library import find_symbol
from icmj.errors import SimulationError

T = TypeVar("T")
PLENTY = 1_000_000  # bytes of arena; MuJoCo takes thirteen times as much by itself
MORE = 'give the model more with <size memory="100M"/>'


class EngineFault(SimulationError):
    """MuJoCo raised a fatal error within a step."""


class _Call:
    """A call that runs in a separate thread."""

    def __init__(self) -> None:
        self.ended = threading.Event()
        self.value: object = None
        self.error: BaseException | None = None


_calls: dict[int, _Call] = {}
_installed = threading.Lock()


def can_fault(model: mujoco.MjModel) -> bool:
    """Whether a step of this model may run out of the engine's memory."""
    return not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONSTRAINT or model.narena < PLENTY


def guard(function: Callable[[], T]) -> T:
    """Run ``function()`` in a separate thread. Ctrl-C waits until it has returned.

    Raises:
        EngineFault: if MuJoCo gave up in it. Whatever the function works on stays half-done, and is kept for ever.
    """
    call = _Call()

    def work() -> None:
        _calls[threading.get_ident()] = call
        try:
            call.value = function()
        except BaseException as error:
            call.error = error
        finally:
            del _calls[threading.get_ident()]
            call.ended.set()

    _catch_errors()
    interrupt: BaseException | None = None
    threading.Thread(target=work, daemon=True).start()
    while not call.ended.is_set():
        try:
            call.ended.wait()
        except BaseException as error:  # a signal; the function still works on what the caller will read
            interrupt = error
    if interrupt is not None:
        raise interrupt
    if call.error is not None:
        raise call.error
    return call.value  # type: ignore[return-value]


def format_fault(error: object) -> str:
    """MuJoCo's message in one line, with advice."""
    said = one_line(error, 200)
    return f"MuJoCo gave up: {said}; {MORE}" if "memory" in said or "stack" in said else f"MuJoCo gave up: {said}"


@ctypes.CFUNCTYPE(None, ctypes.c_char_p)
def _handle_failure(message: bytes) -> None:
    """MuJoCo's error handler: notify the waiting caller, and never return; bindings with their own do not call it."""
    call = _calls.get(threading.get_ident())
    text = message.decode(errors="replace") if message else "no message"
    if call is None:  # not one of ours: what MuJoCo does by default
        print(f"ERROR: {text}", file=sys.stderr, flush=True)
        os._exit(1)
    call.error = EngineFault(format_fault(text))
    call.ended.set()
    while True:
        threading.Event().wait()


def _catch_errors() -> None:
    """Register the handler with MuJoCo; a handler that was set by others is kept."""
    with _installed:
        handler = find_symbol("mju_user_error")
        if not handler.value:
            handler.value = ctypes.cast(_handle_failure, ctypes.c_void_p).value
