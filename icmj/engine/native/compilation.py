"""How this package compiles: with numba, without the GIL, kept on disk, the engine's functions within reach.

Compiled code reads and writes MuJoCo's structs in place and calls the engine's functions by their symbols, so that
numba can keep it on disk and the next process starts without compiling. numba compiles anew when the source file
changes that a function stands in, or its closure variables do, but not when a function does that it calls. So only
entry points are kept, and each holds :func:`sources`, which changes with any file of the engine, as a closure variable.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding  # type: ignore[import-untyped]
import mujoco
import numba

from icmj.errors import ModelError


@cache
def load_engine() -> None:
    """Make the engine's symbols known to compiled code.

    Raises:
        ModelError: if MuJoCo's library is not where its package is.
    """
    folder = Path(mujoco.__file__).parent
    libraries = [*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]
    if not libraries:
        raise ModelError(f"{folder}: no MuJoCo library here; set native = false, which runs the plain-Python loop")
    llvmlite.binding.load_library_permanently(str(libraries[0]))


@cache
def sources() -> int:
    """A number that changes with any source file of the engine, whose functions and constants compiled code holds."""
    folder = Path(__file__).parents[1]
    content = b"\0".join(file.read_bytes() for file in sorted(folder.rglob("*.py")))
    return int.from_bytes(hashlib.sha256(content + mujoco.__version__.encode()).digest()[:6])


def entry(function: Callable[..., Any]) -> Any:
    """``numba.njit`` without the GIL, kept on disk where numba finds a folder that it may write to.

    The function must use a closure variable that is :func:`sources`.
    """
    return _kept(numba.njit, {"nogil": True, "error_model": "numpy"})(function)


def entry_cfunc(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """``numba.cfunc``, kept on disk likewise."""
    return _kept(lambda **options: numba.cfunc(signature, **options), {"error_model": "numpy"})


def compiled(function: Callable[..., Any]) -> Any:
    """A function that entry points call."""
    return numba.njit(nogil=True, error_model="numpy")(function)


def inlined(function: Callable[..., Any]) -> Any:
    """:func:`compiled` into its callers: a call would copy all arguments, which here are many.

    Sums may be reassociated, so that they vectorise; the order is fixed at compile time all the same.
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "forceinline": True}
    return numba.njit(fastmath={"reassoc", "contract"}, **options)(function)


def exact(function: Callable[..., Any]) -> Any:
    """:func:`inlined`, with every sum in the order written: for what has to equal the engine's to the last bit."""
    return numba.njit(nogil=True, error_model="numpy", forceinline=True)(function)


def _kept(make: Callable[..., Any], options: dict[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return make(cache=True, **options)(function)
        except RuntimeError:  # no folder for the cache: compile in every process
            return make(**options)(function)

    return decorate
