"""The engine's memory: addresses as numbers, and arrays where they point."""

# numba rewrites signatures of intrinsics and calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic

from icmj.engine.native.compilation import inlined


@intrinsic
def pointer(typing_context: Any, address: Any) -> Any:
    """An address as a ``voidptr``, in compiled code."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.intp), codegen


@inlined
def word(base, at):  # type: ignore[no-untyped-def]
    """The 64-bit word (size or pointer) at ``base + at``, in compiled code."""
    return carray(pointer(base + at), 1, np.int64)[0]


@inlined
def bare(array):  # type: ignore[no-untyped-def]
    """The same array without a reference count, in compiled code; whoever calls it keeps the memory alive.

    Counting references is atomic, and a step would count a hundred of them.
    """
    return carray(pointer(array.ctypes.data), array.shape, array.dtype)


def view(address: int, kind: Any, size: int) -> np.ndarray:
    """A numpy view of the engine's own memory."""
    return np.ctypeslib.as_array((kind * size).from_address(address))


DOUBLE, INT = ctypes.c_double, ctypes.c_int32
