"""The controller as MuJoCo's callbacks: outputs afresh, the command, and the rates of observer and hold.

They hold no state of their own: everything is in the model that they are called on, so runs on different models may go
on in different threads. They cannot raise.
"""

# numba rewrites signatures of intrinsics and calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np

from icmj.engine import actuator as actuators
from icmj.engine import block, signals
from icmj.engine.block import Slot
from icmj.engine.native.compilation import allocating, compiled, engine_function, entry_cfunc, inlined, sources
from icmj.engine.native.memory import doubles, field, integers, number, size
from icmj.engine.native.pushing import push
from icmj.engine.native.waves import dot, waves_at

_sensor_pos, _sensor_vel = engine_function("mj_sensorPos"), engine_function("mj_sensorVel")

# Constants that compiled code freezes; MuJoCo's layout enters by closure variables instead (see callbacks). Code gone
# stale is caught at start-up by icmj.engine.native.loop.
_MAGIC, _VERSION, _HEADER, _SIGNAL = block.MAGIC, block.VERSION, block.HEADER, signals.SIGNAL
_N_DYN, _USER = int(mujoco.mjNDYN), int(mujoco.mjtDyn.mjDYN_USER)
_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)
_lag = compiled(actuators.lag)


class ModelFields(NamedTuple):
    """Addresses of the model's fields that the callbacks read; see :func:`icmj.engine.native.memory.field`."""

    nu: Any
    nv: Any
    na: Any
    nnumeric: Any
    numeric_adr: Any
    numeric_size: Any
    numeric_data: Any
    actuator_actadr: Any
    actuator_actnum: Any
    actuator_dyntype: Any
    actuator_dynprm: Any


class DataFields(NamedTuple):
    """Addresses of the fields of MuJoCo's data that the callbacks read and write."""

    time: Any
    ctrl: Any
    act: Any
    act_dot: Any
    sensordata: Any
    qfrc_applied: Any
    moment_rownnz: Any
    moment_rowadr: Any
    moment_colind: Any
    actuator_moment: Any


@inlined
def _ours(b, controls, activations):  # type: ignore[no-untyped-def]
    """Whether a block belongs to a composed model with so many controls and activations."""
    if b[Slot.MAGIC] != _MAGIC or b[Slot.VERSION] != _VERSION:
        return False
    return controls == b[Slot.N_U] + 1 and activations == b[Slot.ACT] + b[Slot.SIZE]


@allocating
def _block(m, of):  # type: ignore[no-untyped-def]
    """The controller's numbers in a model; empty where there is none, as in the compiler's temporary model."""
    numbers, k = doubles(m, of.numeric_data), size(m, of.nnumeric) - 1
    if k < 0 or integers(m, of.numeric_size)[k] < _HEADER:
        return numbers[:0]
    b = numbers[integers(m, of.numeric_adr)[k] :]
    return b if _ours(b, size(m, of.nu), size(m, of.na)) else numbers[:0]


@compiled
def shares(b, a, ctrl, waves):  # type: ignore[no-untyped-def]
    """Add noises whose size is a share of the command −K a to ``ctrl``."""
    size, at_K, last = int(b[Slot.SIZE]), int(b[Slot.AT_K]), int(b[Slot.SIGNALS])
    for k in range(last - int(b[Slot.SHARES]), last):
        i = int(b[int(b[Slot.AT_SIGNALS]) + _SIGNAL * k])
        ctrl[i] -= waves[k] * dot(b[at_K + i * size : at_K + (i + 1) * size], a[:size])


@compiled
def _respond(b, y, ctrl, waves):  # type: ignore[no-untyped-def]
    """Add −S (y + n(t) − y_0) to ``ctrl``."""
    n_y, at_0, at_S, commanded = int(b[Slot.N_Y]), int(b[Slot.AT_Y_0]), int(b[Slot.AT_S]), int(b[Slot.COMMANDED])
    for i in range(int(b[Slot.DIRECT])):
        for j in range(n_y):
            ctrl[i] -= b[at_S + i * n_y + j] * (y[j] - b[at_0 + j])
        signal = int(b[Slot.AT_SIGNALS]) + _SIGNAL * commanded
        for k in range(commanded, commanded + int(b[Slot.READ])):
            ctrl[i] -= b[at_S + i * n_y + int(b[signal])] * waves[k]
            signal += _SIGNAL


@compiled
def _add_course(b, place, rows, out, waves):  # type: ignore[no-untyped-def]
    """Add polynomials in (t − SINCE)/UNIT, ``rows`` of them at ``place``, to ``out``."""
    powers, at = int(b[Slot.POWERS]), place
    theta = (waves[int(b[Slot.SIGNALS])] - b[Slot.SINCE]) / b[Slot.UNIT]
    for i in range(rows):
        value = 0.0
        for j in range(powers - 1, -1, -1):
            value = value * theta + b[at + j]
        out[i] += value
        at += powers


@compiled
def command(b, a, y, ctrl, waves):  # type: ignore[no-untyped-def]
    """ctrl = ctrl_0 − K a − S (y + n(t) − y_0) + d(t), with what is a function of time alone; ``waves`` are of now."""
    size, at, at_span, at_0 = int(b[Slot.SIZE]), int(b[Slot.AT_K]), int(b[Slot.AT_SPAN_K]), int(b[Slot.AT_CTRL_0])
    first = int(b[at_span])
    count = int(b[at_span + 1]) - first
    for i in range(int(b[Slot.N_U])):
        ctrl[i] = b[at_0 + i] - dot(b[at + i * size + first : at + i * size + first + count], a[first : first + count])
    at = int(b[Slot.AT_SIGNALS])
    for k in range(int(b[Slot.COMMANDED])):
        ctrl[int(b[at])] += waves[k]
        at += _SIGNAL
    if b[Slot.SHARES] > 0:
        shares(b, a, ctrl, waves)
    if b[Slot.DIRECT] > 0:
        _respond(b, y, ctrl, waves)
    if b[Slot.POWERS] > 0:
        _add_course(b, int(b[Slot.AT_COURSE]), int(b[Slot.N_U]), ctrl, waves)


@compiled
def rates(b, a, y, rate, waves):  # type: ignore[no-untyped-def]
    """ȧ = M a + N (y + n(t) − y_0)."""
    size, n_y, at_0, commanded = int(b[Slot.SIZE]), int(b[Slot.N_Y]), int(b[Slot.AT_Y_0]), int(b[Slot.COMMANDED])
    at_M, at_N, n_v, at = int(b[Slot.AT_M]), int(b[Slot.AT_N]), int(b[Slot.N_V]), int(b[Slot.AT_SEGMENTS])
    for _ in range(int(b[Slot.SEGMENTS])):
        start, end, first = int(b[at]), int(b[at + 1]), int(b[at + 2])
        count = int(b[at + 3]) - first
        for i in range(start, end):
            rate[i] = dot(b[at_M + i * size + first : at_M + i * size + first + count], a[first : first + count])
        if b[at + 4] != 0:
            for j in range(n_y):
                departure = y[j] - b[at_0 + j]
                for i in range(start, end):
                    rate[i] += b[at_N + i * n_v + j] * departure
            signal = int(b[Slot.AT_SIGNALS]) + _SIGNAL * commanded
            for k in range(commanded, commanded + int(b[Slot.READ])):
                column = at_N + int(b[signal])
                for i in range(start, end):
                    rate[i] += b[column + i * n_v] * waves[k]
                signal += _SIGNAL
        at += 5
    if b[Slot.RATED] > 0:
        _add_course(b, int(b[Slot.AT_DRIFT]), size, rate, waves)


@allocating
def _waves(b, time):  # type: ignore[no-untyped-def]
    count = int(b[Slot.SIGNALS])
    waves = np.empty(count + 2)
    waves[count] = np.nan
    waves_at(b, waves, time)
    return waves


@cache
def callbacks() -> tuple[Any, Any]:
    """(control, act_dyn) for MuJoCo: ctypes function objects, or Python functions where the code is interpreted.

    They act on composed models only; on others, the compiler's temporary model included, they do nothing.
    """
    # closure variables are part of numba's cache key, so another layout compiles anew
    of_model = ModelFields(*(field("mjModel", name) for name in ModelFields._fields))
    of_data = DataFields(*(field("mjData", name) for name in DataFields._fields))
    source = sources()

    @entry_cfunc("void(intp, intp)")
    def control(m, d):  # type: ignore[no-untyped-def]
        b = _block(m, of_model)
        if len(b) == 0 or source == 0:
            return
        _sensor_pos(m, d)
        if b[Slot.STAGE] >= _VELOCITY:
            _sensor_vel(m, d)
        waves = _waves(b, number(d, of_data.time))
        y = doubles(d, of_data.sensordata)
        command(b, doubles(d, of_data.act)[int(b[Slot.ACT]) :], y, doubles(d, of_data.ctrl), waves)
        if b[Slot.PUSHES] > 0:
            moments = (
                integers(d, of_data.moment_rownnz),
                integers(d, of_data.moment_rowadr),
                integers(d, of_data.moment_colind),
                doubles(d, of_data.actuator_moment),
            )
            push(b, m, d, moments, doubles(d, of_data.qfrc_applied)[: size(m, of_model.nv)], waves)

    @entry_cfunc("float64(intp, intp, int32)")
    def act_dyn(m, d, actuator):  # type: ignore[no-untyped-def]
        b = _block(m, of_model)
        if len(b) == 0 or source == 0:
            return 0.0
        act, rate = doubles(d, of_data.act), doubles(d, of_data.act_dot)
        if actuator == size(m, of_model.nu) - 1:
            y, first = doubles(d, of_data.sensordata), int(b[Slot.ACT])
            rates(b, act[first:], y, rate[first:], _waves(b, number(d, of_data.time)))
            return 0.0
        # one of the plant's own actuators: a second-order lag, or one that moves as the engine has it
        lags = integers(m, of_model.actuator_dyntype)[actuator] == _USER
        parameters = doubles(m, of_model.actuator_dynprm)[_N_DYN * actuator :]
        if lags and integers(m, of_model.actuator_actnum)[actuator] == 2 and parameters[0] > 0:
            at, u = integers(m, of_model.actuator_actadr)[actuator], doubles(d, of_data.ctrl)[actuator]
            rate[at], rate[at + 1] = _lag(u, act[at], act[at + 1], parameters[0], parameters[1])
        return 0.0

    return control, act_dyn
