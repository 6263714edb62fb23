"""How the engine's code is compiled: as :mod:`icmj.base.compilation` does, with the engine's functions within reach.

Compiled code reads and writes MuJoCo's structs in place and calls the engine's functions by their symbols, so that
numba can keep it on disk and the next process starts without compiling. Interpreted, the same code calls these
functions through MuJoCo's Python bindings: models and data are then objects, and arrays go to the engine as they are.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import mujoco

from icmj.base.compilation import allocating, called, compiled, contents, entry, inlined, within
from icmj.base.compilation import c_entry as entry_cfunc
from icmj.base.environment import INTERPRETED, SWITCH
from icmj.engine.fault import guarded
from icmj.errors import ModelError

__all__ = [
    "allocating",
    "compiled",
    "engine_function",
    "entry",
    "entry_cfunc",
    "exact",
    "inlined",
    "merged",
    "run_guarded",
    "sources",
]

MODEL_AND_DATA = "void(intp, intp)"

exact = within(forceinline=True, _nrt=False)
"""``inlined``, with every sum in the order written: for what has to equal the engine's to the last bit."""
merged = within(inline="always")
"""A function that stands in one entry point as if written there: it is not compiled twice."""


@cache
def _load_engine() -> None:
    """Make the engine's symbols known to compiled code.

    Raises:
        ModelError: if MuJoCo's library is not where its package is.
    """
    import llvmlite.binding  # type: ignore[import-untyped]

    folder = Path(mujoco.__file__).parent
    libraries = [*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]
    if not libraries:
        raise ModelError(f"{folder}: no MuJoCo library here; {SWITCH}")
    llvmlite.binding.load_library_permanently(str(libraries[0]))


@cache
def sources() -> int:
    """A number that changes with any source file of the engine, whose functions and constants compiled code holds."""
    return contents(Path(__file__).parents[1], mujoco.__version__)


def engine_function(name: str, signature: str = MODEL_AND_DATA) -> Any:
    """A function of MuJoCo, for both compiled and interpreted code.

    In the signature pointers are integers of their size: the same registers, and no type to convert.

    Raises:
        ModelError: if MuJoCo's library is not where its package is.
    """
    if INTERPRETED:
        return _solve if name == "mj_solveM" else getattr(mujoco, name)
    from numba import types
    from numba.core.sigutils import normalize_signature

    _load_engine()
    arguments, result = normalize_signature(signature)
    return types.ExternalFunction(name, result(*arguments))


def _solve(model: mujoco.MjModel, data: mujoco.MjData, x: Any, y: Any, n: int) -> None:
    """mj_solveM with its right-hand sides as C takes them, one after the other; the bindings want a matrix."""
    mujoco.mj_solveM(model, data, x.reshape(n, -1), y.reshape(n, -1))


def run_guarded(dispatcher: Any, arguments: tuple[Any, ...], faulty: bool) -> Any:
    """``dispatcher(*arguments)``; where it is ``faulty`` MuJoCo may give up in it, which is caught.

    Raises:
        EngineFault: if MuJoCo gives up; ``mujoco.FatalError`` of its bindings where the code is interpreted.
    """
    if faulty and not INTERPRETED:
        return guarded(lambda: called(dispatcher, *arguments))
    return called(dispatcher, *arguments)
