"""Forces on the model itself, in compiled code; what :mod:`icmj.engine.pushing` does in plain Python."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import numpy as np
from numba import types

from icmj.engine import pushing
from icmj.engine.block import Slot
from icmj.engine.native.compilation import compiled, load_engine

load_engine()

# pointers travel as integers of their size: the same registers, and no type to convert
_apply = types.ExternalFunction(
    "mj_applyFT",
    types.void(types.intp, types.intp, types.intp, types.intp, types.intp, types.int32, types.intp),
)
_global = types.ExternalFunction(
    "mj_local2Global",
    types.void(types.intp, types.intp, types.intp, types.intp, types.intp, types.int32, types.uint8),
)

# constants that compiled code freezes
_FREEDOM, _ACTUATOR, _WIDTH = pushing.FREEDOM, pushing.ACTUATOR, pushing.WIDTH


@compiled
def push(b, m, d, moments, applied, waves):  # type: ignore[no-untyped-def]
    """Write the generalised forces of pushes where the engine is into ``applied``.

    ``moments`` are those of the actuators as MuJoCo keeps them: numbers of entries, first entries, columns, values.
    """
    for i in range(len(applied)):
        applied[i] = 0.0
    rownnz, rowadr, column, value = moments
    vectors = np.empty(9)  # force, torque, point in the world
    at, first = int(b[Slot.AT_SIZES]), int(b[Slot.TERMS]) + int(b[Slot.ERRORS])
    for k in range(int(b[Slot.SIZES])):
        size, row = waves[first + k], int(b[Slot.AT_PUSHES]) + _WIDTH * int(b[at])
        at += 6
        if size == 0:
            continue
        index = int(b[row + 1])
        if b[row] == _FREEDOM:
            applied[index] += size * b[row + 2]
        elif b[row] == _ACTUATOR:
            for j in range(rowadr[index], rowadr[index] + rownnz[index]):
                applied[column[j]] += size * b[row + 2] * value[j]
        else:
            for i in range(6):
                vectors[i] = size * b[row + 5 + i]
            here = vectors.ctypes.data
            _global(d, here + 48, 0, b.ctypes.data + 8 * (row + 2), 0, index, 0)
            _apply(m, d, here, here + 24, here + 48, index, applied.ctypes.data)
