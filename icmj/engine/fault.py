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
from functools import cache
from pathlib import Path
from typing import TypeVar

import mujoco

from icmj.base.text import one_line
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


def guarded(function: Callable[[], T]) -> T:
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

    _install()
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


def words(error: object) -> str:
    """MuJoCo's message in one line, with advice."""
    said = one_line(error, 200)
    return f"MuJoCo gave up: {said}; {MORE}" if "memory" in said or "stack" in said else f"MuJoCo gave up: {said}"


@ctypes.CFUNCTYPE(None, ctypes.c_char_p)
def _failed(message: bytes) -> None:
    """MuJoCo's error handler: notify the waiting caller, and never return; bindings with their own do not call it."""
    call = _calls.get(threading.get_ident())
    text = message.decode(errors="replace") if message else "no message"
    if call is None:  # not one of ours: what MuJoCo does by default
        print(f"ERROR: {text}", file=sys.stderr, flush=True)
        os._exit(1)
    call.error = EngineFault(words(text))
    call.ended.set()
    while True:
        threading.Event().wait()


def library() -> Path:
    """MuJoCo's own library, that its bindings call."""
    folder = Path(mujoco.__file__).parent
    return next(iter([*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]))


@cache
def _handler() -> ctypes.c_void_p:
    return ctypes.c_void_p.in_dll(ctypes.CDLL(str(library())), "mju_user_error")


def _install() -> None:
    """Register the handler with MuJoCo; a handler that was set by others is kept."""
    with _installed:
        handler = _handler()
        if not handler.value:
            handler.value = ctypes.cast(_failed, ctypes.c_void_p).value
