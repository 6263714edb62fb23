"""The controller as native callbacks; what :mod:`icmj.engine.reference` does in plain Python.

They hold no state of their own: everything is in the model that they are called on, so runs on different models may go
on in different threads. They cannot raise.
"""

# numba rewrites signatures of intrinsics and calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np
from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic

from icmj.engine import composition, structs
from icmj.engine.compilation import cfunc, inlined, load_engine
from icmj.engine.composition import Slot

load_engine()

# pointers travel as integers of their size: the same registers, and no type to convert
_sensor_pos = types.ExternalFunction("mj_sensorPos", types.void(types.intp, types.intp))
_sensor_vel = types.ExternalFunction("mj_sensorVel", types.void(types.intp, types.intp))

# Constants that compiled code freezes; MuJoCo's layout enters by closure variables instead (see callbacks). Code gone
# stale is caught at start-up by icmj.engine.native_loop.
_MAGIC, _VERSION, _HEADER = composition.MAGIC, composition.VERSION, composition.HEADER
_S_MAGIC, _S_VERSION, _S_N_HAT, _S_N_U = int(Slot.MAGIC), int(Slot.VERSION), int(Slot.N_HAT), int(Slot.N_U)
_S_N_Y, _S_ACT, _S_STAGE, _S_PHASE = int(Slot.N_Y), int(Slot.ACT), int(Slot.STAGE), int(Slot.PHASE)
_S_TERMS, _S_TRIGGER = int(Slot.TERMS), int(Slot.TRIGGER)
_CONTINUOUS = composition.CONTINUOUS


@intrinsic
def _pointer(typing_context: Any, address: Any) -> Any:
    """An address as a ``voidptr``."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.intp), codegen


@inlined
def _word(base, at):  # type: ignore[no-untyped-def]
    """The 64-bit word (size or pointer) at ``base + at``."""
    return carray(_pointer(base + at), 1, np.int64)[0]


@inlined
def _dot(values, at, act, start, n):  # type: ignore[no-untyped-def]
    total = 0.0
    for j in range(n):
        total += values[at + j] * act[start + j]
    return total


@inlined
def _control(header, values, act, ctrl, time):  # type: ignore[no-untyped-def]
    """ctrl = ctrl_0 − K a + d(t); ``values`` are the blocks after the header."""
    n, n_u, n_y = int(header[_S_N_HAT]), int(header[_S_N_U]), int(header[_S_N_Y])
    at = 4 * n * n + 2 * n * n_y
    constant = at + 2 * n * n_u + n * n + n_y
    # K has one half that is not zero: for x_h, or for x_o under continuous control
    used = 0 if header[_S_TRIGGER] == _CONTINUOUS else n
    for i in range(n_u):
        ctrl[i] = values[constant + i] - _dot(values, at + used, act, used, n)
        at += 2 * n
    phase = header[_S_PHASE]
    if phase < 0:
        phase = time
    at = constant + n_u
    for _ in range(int(header[_S_TERMS])):
        if values[at + 4] <= phase < values[at + 5]:
            ctrl[int(values[at])] += values[at + 1] * np.cos(values[at + 2] * time + values[at + 3])
        at += 6


@inlined
def _rates(header, values, act, y, rate):  # type: ignore[no-untyped-def]
    """ȧ = M a + N (y − y_0), without the halves of M and N that are zero."""
    n, n_u, n_y = int(header[_S_N_HAT]), int(header[_S_N_U]), int(header[_S_N_Y])
    size = 2 * n
    continuous = header[_S_TRIGGER] == _CONTINUOUS
    used = n if continuous else size
    at_N = size * size
    at_y = at_N + size * n_y + size * n_u + n * n
    for i in range(n):
        rate[i] = _dot(values, i * size, act, 0, used)
    for j in range(n_y):
        departure = y[j] - values[at_y + j]
        for i in range(n):
            rate[i] += values[at_N + i * n_y + j] * departure
    if continuous:
        for i in range(n):
            rate[n + i] = rate[i]
    else:
        for i in range(n, size):
            rate[i] = _dot(values, i * size + n, act, n, n)


@cache
def callbacks() -> tuple[Any, Any]:
    """(control, act_dyn) as ctypes function objects for MuJoCo.

    They act on composed models only; on others, the compiler's temporary model included, they do nothing.
    """
    # closure variables are part of numba's cache key, so another layout compiles anew
    nu, n_numeric = structs.offset("mjModel", "nu"), structs.offset("mjModel", "nnumeric")
    numeric_adr, numeric_size, numeric_data = (
        structs.offset("mjModel", f"numeric_{part}") for part in ("adr", "size", "data")
    )
    na = structs.offset("mjModel", "na")
    actadr, actnum, dyntype, dynprm = (
        structs.offset("mjModel", f"actuator_{part}") for part in ("actadr", "actnum", "dyntype", "dynprm")
    )
    time, ctrl, act, act_dot, sensordata = (
        structs.offset("mjData", part) for part in ("time", "ctrl", "act", "act_dot", "sensordata")
    )
    n_dyn, user = int(mujoco.mjNDYN), int(mujoco.mjtDyn.mjDYN_USER)
    velocity = int(mujoco.mjtStage.mjSTAGE_VEL)

    @cfunc(types.void(types.intp, types.intp))
    def control(m, d):  # type: ignore[no-untyped-def]
        k = _word(m, n_numeric) - 1
        if k < 0 or carray(_pointer(_word(m, numeric_size)), k + 1, np.int32)[k] < _HEADER:
            return
        at = _word(m, numeric_data) + 8 * carray(_pointer(_word(m, numeric_adr)), k + 1, np.int32)[k]
        header = carray(_pointer(at), _HEADER, np.float64)
        if header[_S_MAGIC] != _MAGIC or header[_S_VERSION] != _VERSION:
            return
        n, start = int(header[_S_N_HAT]), int(header[_S_ACT])
        if _word(m, nu) != header[_S_N_U] + 1 or _word(m, na) != start + 2 * n:
            return
        _sensor_pos(m, d)
        if header[_S_STAGE] >= velocity:
            _sensor_vel(m, d)
        values = carray(_pointer(at + 8 * _HEADER), 1 << 40, np.float64)
        a = carray(_pointer(_word(d, act) + 8 * start), 2 * n, np.float64)
        u = carray(_pointer(_word(d, ctrl)), int(header[_S_N_U]), np.float64)
        _control(header, values, a, u, carray(_pointer(d + time), 1, np.float64)[0])

    @cfunc(types.float64(types.intp, types.intp, types.int32))
    def act_dyn(m, d, actuator):  # type: ignore[no-untyped-def]
        k = _word(m, n_numeric) - 1
        if k < 0 or carray(_pointer(_word(m, numeric_size)), k + 1, np.int32)[k] < _HEADER:
            return 0.0
        at = _word(m, numeric_data) + 8 * carray(_pointer(_word(m, numeric_adr)), k + 1, np.int32)[k]
        header = carray(_pointer(at), _HEADER, np.float64)
        if header[_S_MAGIC] != _MAGIC or header[_S_VERSION] != _VERSION:
            return 0.0
        n, start = int(header[_S_N_HAT]), int(header[_S_ACT])
        if _word(m, nu) != header[_S_N_U] + 1 or _word(m, na) != start + 2 * n:
            return 0.0
        a = carray(_pointer(_word(d, act)), start + 2 * n, np.float64)
        rate = carray(_pointer(_word(d, act_dot)), start + 2 * n, np.float64)
        if actuator == _word(m, nu) - 1:
            values = carray(_pointer(at + 8 * _HEADER), 1 << 40, np.float64)
            y = carray(_pointer(_word(d, sensordata)), int(header[_S_N_Y]), np.float64)
            _rates(header, values, a[start:], y, rate[start:])
            return 0.0
        # one of the plant's own actuators: a second-order lag, or none of ours
        count = carray(_pointer(_word(m, actnum)), actuator + 1, np.int32)[actuator]
        kind = carray(_pointer(_word(m, dyntype)), actuator + 1, np.int32)[actuator]
        parameters = carray(_pointer(_word(m, dynprm) + 8 * n_dyn * actuator), n_dyn, np.float64)
        if kind == user and count == 2 and parameters[0] > 0:
            first = carray(_pointer(_word(m, actadr)), actuator + 1, np.int32)[actuator]
            u = carray(_pointer(_word(d, ctrl)), actuator + 1, np.float64)[actuator]
            w = parameters[0]
            rate[first] = w * w * (u - a[first + 1]) - 2 * parameters[1] * w * a[first]
            rate[first + 1] = a[first]
        return 0.0

    return control.ctypes, act_dyn.ctypes
