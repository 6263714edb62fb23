"""How the engine's code is compiled: as :mod:`icmj.base.compilation` does, with the engine's functions within reach.

Compiled code reads and writes MuJoCo's structs in place and calls the engine's functions by their symbols, so that
numba can keep it on disk and the next process starts without compiling.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding  # type: ignore[import-untyped]
import mujoco
import numba

from icmj.base.compilation import WITHIN, compiled, contents, entry, inlined, kept
from icmj.errors import ModelError

__all__ = ["compiled", "entry", "entry_cfunc", "exact", "inlined", "load_engine", "sources"]


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
    return contents(Path(__file__).parents[1], mujoco.__version__)


def entry_cfunc(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """``numba.cfunc``, kept on disk likewise."""
    return kept(lambda **options: numba.cfunc(signature, **options), {"error_model": "numpy"})


def merged(function: Callable[..., Any]) -> Any:
    """A function that stands in one entry point as if written there: it is not compiled twice."""
    return numba.njit(inline="always", **WITHIN)(function)


def exact(function: Callable[..., Any]) -> Any:
    """:func:`inlined`, with every sum in the order written: for what has to equal the engine's to the last bit."""
    return numba.njit(forceinline=True, **WITHIN)(function)
