"""Forces on bodies, in the compiled loops; :mod:`icmj.engine.pushing` has the same in numpy for the analysis."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import numpy as np

from icmj.engine import pushing, signals
from icmj.engine.block import Slot
from icmj.engine.native.compilation import allocating, engine_function
from icmj.engine.native.memory import address

_apply = engine_function("mj_applyFT", "void(intp, intp, intp, intp, intp, int32, intp)")
_global = engine_function("mj_local2Global", "void(intp, intp, intp, intp, intp, int32, uint8)")

# constants that compiled code freezes
_FREEDOM, _ACTUATOR, _WIDTH, _SIGNAL = pushing.FREEDOM, pushing.ACTUATOR, pushing.WIDTH, signals.SIGNAL


@allocating
def push(b, m, d, moments, applied, waves):  # type: ignore[no-untyped-def]
    """Write the generalised forces of pushes where the engine is into ``applied``.

    ``moments`` are those of the actuators as MuJoCo keeps them: numbers of entries, first entries, columns, values.
    """
    for i in range(len(applied)):
        applied[i] = 0.0
    rownnz, rowadr, column, value = moments
    vectors = np.zeros(22)  # force, torque, point in the world; a rotation that nobody asks for, there and in the body
    force, torque, there = vectors[:3], vectors[3:6], vectors[6:9]
    first = int(b[Slot.COMMANDED]) + int(b[Slot.READ])
    at = int(b[Slot.AT_SIGNALS]) + _SIGNAL * first
    for k in range(first, int(b[Slot.SIGNALS]) - int(b[Slot.SHARES])):
        size, row = waves[k], int(b[Slot.AT_PUSHES]) + _WIDTH * int(b[at])
        at += _SIGNAL
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
            point = b[row + 2 : row + 5]
            _global(d, address(there), address(vectors[9:18]), address(point), address(vectors[18:]), index, 0)
            _apply(m, d, address(force), address(torque), address(there), index, address(applied))
