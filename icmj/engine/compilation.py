"""How this package compiles: with numba, without the GIL, kept on disk, the engine's functions within reach.

Compiled code reads and writes MuJoCo's structs in place and calls the engine's functions by their symbols, so that
numba can keep it on disk and the next process starts without compiling. numba compiles anew when the source file
changes that a function stands in, or its closure variables do; so no compiled function calls one of another module.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding  # type: ignore[import-untyped]
import mujoco
import numba

from icmj.errors import ModelError


def load_engine() -> None:
    """Make the engine's symbols known to compiled code."""
    folder = Path(mujoco.__file__).parent
    libraries = [*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]
    if not libraries:
        raise ModelError(f"{folder}: no MuJoCo library here; use the plain-Python loop (native=False)")
    llvmlite.binding.load_library_permanently(str(libraries[0]))


def compiled(function: Callable[..., Any]) -> Any:
    """``numba.njit`` without the GIL, kept on disk where numba finds a folder that it may write to."""
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # no folder for the cache: compile in every process
        return numba.njit(nogil=True, error_model="numpy")(function)


def inlined(function: Callable[..., Any]) -> Any:
    """:func:`compiled` into its callers: a call would copy all arguments, which here are many.

    Sums may be reassociated, so that they vectorise; the order is fixed at compile time all the same.
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "forceinline": True}
    options["fastmath"] = {"reassoc", "contract"}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:
        return numba.njit(**options)(function)


def cfunc(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return numba.cfunc(signature, cache=True, error_model="numpy")(function)
        except RuntimeError:
            return numba.cfunc(signature, error_model="numpy")(function)

    return decorate
