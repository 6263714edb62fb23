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

from icmj.engine import block
from icmj.engine.block import Slot
from icmj.engine.native import structs
from icmj.engine.native.compilation import compiled, entry_cfunc, exact, inlined, load_engine, sources
from icmj.engine.native.memory import pointer, word
from icmj.engine.native.pushing import push

load_engine()

# pointers travel as integers of their size: the same registers, and no type to convert
_sensor_pos = types.ExternalFunction("mj_sensorPos", types.void(types.intp, types.intp))
_sensor_vel = types.ExternalFunction("mj_sensorVel", types.void(types.intp, types.intp))

# Constants that compiled code freezes; MuJoCo's layout enters by closure variables instead (see callbacks). Code gone
# stale is caught at start-up by icmj.engine.native.loop.
_MAGIC, _VERSION, _HEADER = block.MAGIC, block.VERSION, block.HEADER


@inlined
def _numeric(m, n_numeric, numeric_size, numeric_adr, numeric_data):  # type: ignore[no-untyped-def]
    """Address of the last numeric's data, or 0 where there is none as long as a header."""
    k = word(m, n_numeric) - 1
    if k < 0 or carray(pointer(word(m, numeric_size)), k + 1, np.int32)[k] < _HEADER:
        return 0
    return word(m, numeric_data) + 8 * carray(pointer(word(m, numeric_adr)), k + 1, np.int32)[k]


@inlined
def _ours(b, controls, activations):  # type: ignore[no-untyped-def]
    """Whether a block belongs to a composed model with so many controls and activations."""
    if b[Slot.MAGIC] != _MAGIC or b[Slot.VERSION] != _VERSION:
        return False
    return controls == b[Slot.N_U] + 1 and activations == b[Slot.ACT] + b[Slot.SIZE]


@exact
def _dot(b, at, vector, first, count):  # type: ignore[no-untyped-def]
    """Four sums side by side, in an order that is the same wherever this is compiled into."""
    s_0, s_1, s_2, s_3 = 0.0, 0.0, 0.0, 0.0
    whole = count // 4 * 4
    for j in range(0, whole, 4):
        s_0 += b[at + j] * vector[first + j]
        s_1 += b[at + j + 1] * vector[first + j + 1]
        s_2 += b[at + j + 2] * vector[first + j + 2]
        s_3 += b[at + j + 3] * vector[first + j + 3]
    for j in range(whole, count):
        s_0 += b[at + j] * vector[first + j]
    return (s_0 + s_1) + (s_2 + s_3)


@exact
def _term(b, at, time):  # type: ignore[no-untyped-def]
    """a·cos(ω t + φ) within its window, else zero."""
    phase = b[Slot.PHASE]
    if phase < 0:
        phase = time
    if b[at + 4] <= phase < b[at + 5]:
        return b[at + 1] * np.cos(b[at + 2] * time + b[at + 3])
    return 0.0


@compiled
def waves_at(b, waves, time):  # type: ignore[no-untyped-def]
    """The terms of disturbance, errors and pushes at a time, kept with it: a step asks twice for every time."""
    terms, errors = int(b[Slot.TERMS]), int(b[Slot.ERRORS])
    count = terms + errors + int(b[Slot.SIZES])
    if waves[count] == time and waves[count + 1] == b[Slot.PHASE]:
        return
    for k in range(count):
        if k < terms:
            at = int(b[Slot.AT_TERMS]) + 6 * k
        elif k < terms + errors:
            at = int(b[Slot.AT_ERRORS]) + 6 * (k - terms)
        else:
            at = int(b[Slot.AT_SIZES]) + 6 * (k - terms - errors)
        waves[k] = _term(b, at, time)
    waves[count], waves[count + 1] = time, b[Slot.PHASE]


@compiled
def command(b, a, ctrl, waves):  # type: ignore[no-untyped-def]
    """ctrl = ctrl_0 − K a + d(t)."""
    size, at, at_span, at_0 = int(b[Slot.SIZE]), int(b[Slot.AT_K]), int(b[Slot.AT_SPAN_K]), int(b[Slot.AT_CTRL_0])
    first = int(b[at_span])
    count = int(b[at_span + 1]) - first
    for i in range(int(b[Slot.N_U])):
        ctrl[i] = b[at_0 + i] - _dot(b, at + i * size + first, a, first, count)
    at = int(b[Slot.AT_TERMS])
    for k in range(int(b[Slot.TERMS])):
        ctrl[int(b[at])] += waves[k]
        at += 6


@compiled
def rates(b, a, y, rate, waves):  # type: ignore[no-untyped-def]
    """ȧ = M a + N (y + n(t) − y_0)."""
    size, n_y, at_0, terms = int(b[Slot.SIZE]), int(b[Slot.N_Y]), int(b[Slot.AT_Y_0]), int(b[Slot.TERMS])
    at_M, at_N, at = int(b[Slot.AT_M]), int(b[Slot.AT_N]), int(b[Slot.AT_SEGMENTS])
    for _ in range(int(b[Slot.SEGMENTS])):
        start, end, first = int(b[at]), int(b[at + 1]), int(b[at + 2])
        count = int(b[at + 3]) - first
        for i in range(start, end):
            rate[i] = _dot(b, at_M + i * size + first, a, first, count)
        if b[at + 4] != 0:
            for j in range(n_y):
                departure = y[j] - b[at_0 + j]
                for i in range(start, end):
                    rate[i] += b[at_N + i * n_y + j] * departure
            at_error = int(b[Slot.AT_ERRORS])
            for k in range(int(b[Slot.ERRORS])):
                error, column = waves[terms + k], at_N + int(b[at_error])
                for i in range(start, end):
                    rate[i] += b[column + i * n_y] * error
                at_error += 6
        at += 5


@exact
def _waves(b, time):  # type: ignore[no-untyped-def]
    count = int(b[Slot.TERMS]) + int(b[Slot.ERRORS]) + int(b[Slot.SIZES])
    waves = np.empty(count + 2)
    waves[count] = np.nan
    waves_at(b, waves, time)
    return waves


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
    nv, applied = structs.offset("mjModel", "nv"), structs.offset("mjData", "qfrc_applied")
    rownnz, rowadr, column, value = (
        structs.offset("mjData", part)
        for part in ("moment_rownnz", "moment_rowadr", "moment_colind", "actuator_moment")
    )
    n_dyn, user = int(mujoco.mjNDYN), int(mujoco.mjtDyn.mjDYN_USER)
    velocity = int(mujoco.mjtStage.mjSTAGE_VEL)

    source = sources()

    @entry_cfunc(types.void(types.intp, types.intp))
    def control(m, d):  # type: ignore[no-untyped-def]
        at = _numeric(m, n_numeric, numeric_size, numeric_adr, numeric_data)
        if at == 0 or source == 0:
            return
        b = carray(pointer(at), 1 << 40, np.float64)
        if not _ours(b, word(m, nu), word(m, na)):
            return
        _sensor_pos(m, d)
        if b[Slot.STAGE] >= velocity:
            _sensor_vel(m, d)
        a = carray(pointer(word(d, act) + 8 * int(b[Slot.ACT])), int(b[Slot.SIZE]), np.float64)
        u = carray(pointer(word(d, ctrl)), int(b[Slot.N_U]), np.float64)
        waves = _waves(b, carray(pointer(d + time), 1, np.float64)[0])
        command(b, a, u, waves)
        if b[Slot.PUSHES] > 0:
            moments = (
                carray(pointer(word(d, rownnz)), 1 << 40, np.int32),
                carray(pointer(word(d, rowadr)), 1 << 40, np.int32),
                carray(pointer(word(d, column)), 1 << 40, np.int32),
                carray(pointer(word(d, value)), 1 << 40, np.float64),
            )
            push(b, m, d, moments, carray(pointer(word(d, applied)), word(m, nv), np.float64), waves)

    @entry_cfunc(types.float64(types.intp, types.intp, types.int32))
    def act_dyn(m, d, actuator):  # type: ignore[no-untyped-def]
        at = _numeric(m, n_numeric, numeric_size, numeric_adr, numeric_data)
        if at == 0 or source == 0:
            return 0.0
        b = carray(pointer(at), 1 << 40, np.float64)
        if not _ours(b, word(m, nu), word(m, na)):
            return 0.0
        start, total = int(b[Slot.ACT]), int(b[Slot.ACT]) + int(b[Slot.SIZE])
        a = carray(pointer(word(d, act)), total, np.float64)
        rate = carray(pointer(word(d, act_dot)), total, np.float64)
        if actuator == word(m, nu) - 1:
            y = carray(pointer(word(d, sensordata)), int(b[Slot.N_Y]), np.float64)
            rates(b, a[start:], y, rate[start:], _waves(b, carray(pointer(d + time), 1, np.float64)[0]))
            return 0.0
        # one of the plant's own actuators: a second-order lag, or none of ours
        count = carray(pointer(word(m, actnum)), actuator + 1, np.int32)[actuator]
        kind = carray(pointer(word(m, dyntype)), actuator + 1, np.int32)[actuator]
        parameters = carray(pointer(word(m, dynprm) + 8 * n_dyn * actuator), n_dyn, np.float64)
        if kind == user and count == 2 and parameters[0] > 0:
            first = carray(pointer(word(m, actadr)), actuator + 1, np.int32)[actuator]
            u = carray(pointer(word(d, ctrl)), actuator + 1, np.float64)[actuator]
            w = parameters[0]
            rate[first] = w * w * (u - a[first + 1]) - 2 * parameters[1] * w * a[first]
            rate[first + 1] = a[first]
        return 0.0

    return control.ctypes, act_dyn.ctypes
