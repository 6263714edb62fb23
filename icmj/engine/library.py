"""MuJoCo's shared library, which its Python bindings call."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import mujoco


def find_library() -> Path:
    """MuJoCo's own library, that its bindings call."""
    folder = Path(mujoco.__file__).parent
    return next(iter([*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]))


@cache
def find_symbol(name: str) -> ctypes.c_void_p:
    """A pointer to a function that MuJoCo's library has as a variable."""
    return ctypes.c_void_p.in_dll(ctypes.CDLL(str(find_library())), name)
