"""The controller as MuJoCo's callbacks: the rates of plant, observer and hold at the engine's state.

They come from the fewest stages that give identical results.

The callbacks take the outputs afresh, set the command and give the rates of observer and hold, with the signals and the
forces on bodies of that instant (:mod:`icmj.engine.signals`, :mod:`icmj.engine.forces`). They hold no state of their
own: everything is in the model that they are called on, so runs on different models may go on in different threads.
They cannot raise.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np

from icmj.engine import activations, block, push_table, signals
from icmj.engine.block import Slot
from icmj.engine.native.memory import (
    address,
    allocating,
    compiled,
    doubles,
    engine_function,
    entry_cfunc,
    exact,
    field,
    inlined,
    integers,
    number,
    size,
    sources,
)
from icmj.engine.stages import Stages

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


# constants that compiled code freezes
_SIGNAL, _WEIGHTS, _CELL, _PLACE = signals.SIGNAL, signals.WEIGHTS, signals.CELL, signals.PLACE
_HALF, _KEPT, _GROUP = signals.HALF, signals.KEPT, block.GROUP


@exact
def _sum(b, signal, time):  # type: ignore[no-untyped-def]
    """All terms of a signal, one by one, for callers without cells."""
    value = 0.0
    for k in range(int(b[signal + 3]), int(b[signal + 4])):
        at = int(b[Slot.AT_TERMS]) + 6 * k
        value += b[at + 1] * np.cos(b[at + 2] * time + b[at + 3])
    return value


@compiled
def _turn(b, signal, turned, cell, c, s, cosine, sine):  # type: ignore[no-untyped-def]
    """Rotate the phases of a signal's terms to a cell, from the first cell of its group."""
    begin = cell - cell % _GROUP
    if not begin <= b[turned] <= cell:
        at = int(b[Slot.AT_TERMS]) + 6 * int(b[signal + 3])
        for k in range(len(c)):
            theta = b[at + 2] * ((begin + 0.5) * b[signal + 5]) + b[at + 3]
            c[k], s[k] = np.cos(theta), np.sin(theta)
            at += 6
        b[turned] = begin
    while b[turned] < cell:
        for k in range(len(c)):
            before = c[k]
            c[k] = before * cosine[k] - s[k] * sine[k]
            s[k] = s[k] * cosine[k] + before * sine[k]
        b[turned] += 1


@exact
def dot(left, right):  # type: ignore[no-untyped-def]
    """A dot product with four partial sums, whose order of additions does not depend on the caller."""
    s_0, s_1, s_2, s_3 = 0.0, 0.0, 0.0, 0.0
    whole = len(left) // 4 * 4
    for j in range(0, whole, 4):
        s_0 += left[j] * right[j]
        s_1 += left[j + 1] * right[j + 1]
        s_2 += left[j + 2] * right[j + 2]
        s_3 += left[j + 3] * right[j + 3]
    for j in range(whole, len(left)):
        s_0 += left[j] * right[j]
    return (s_0 + s_1) + (s_2 + s_3)


@compiled
def _fill(b, signal, cells, place, cell):  # type: ignore[no-untyped-def]
    """Compute the coefficients of a cell."""
    first, n = int(b[signal + 3]), int(b[signal + 4]) - int(b[signal + 3])
    table = int(b[Slot.AT_WEIGHTS]) + _WEIGHTS * first
    c, s = b[table : table + n], b[table + n : table + 2 * n]
    _turn(b, signal, cells, cell, c, s, b[table + 2 * n : table + 3 * n], b[table + 3 * n : table + 4 * n])
    for m in range(2 * _HALF):
        at = table + (4 + m) * n
        b[place + 1 + m] = dot(c if m < _HALF else s, b[at : at + n])
    b[place] = cell


@exact
def _interpolated(b, signal, cells, time):  # type: ignore[no-untyped-def]
    """A signal from the cell around a time; the cell is computed if it is not there yet."""
    width = b[signal + 5]
    cell = np.floor(time / width)
    place = cells + 1 + _PLACE * (int(cell) % _KEPT)
    if b[place] != cell:
        _fill(b, signal, cells, place, cell)
    x = 2 * (time - (cell + 0.5) * width) / width
    even, odd, square = 0.0, 0.0, x * x
    for m in range(_HALF - 1, -1, -1):
        even = even * square + b[place + 1 + m]
        odd = odd * square + b[place + 1 + _HALF + m]
    return even + x * odd


@exact
def _straight(b, signal, time):  # type: ignore[no-untyped-def]
    """Gaussian noise, by linear interpolation between two values of its grid."""
    first, last = int(b[Slot.AT_VALUES]) - 1 - int(b[signal + 3]), int(b[Slot.AT_VALUES]) + int(b[signal + 4])
    place = time / b[signal + 5]
    point = min(max(np.floor(place), 0.0), last - first - 2.0)
    at = first + int(point)
    return b[at] + (place - point) * (b[at + 1] - b[at])


@compiled
def waves_at(b, waves, time):  # type: ignore[no-untyped-def]
    """The signals at a time, cached because a step needs them twice at every time.

    A loop has the model to itself, and sets the phase time; nobody else uses the cells.
    """
    count, phase = int(b[Slot.SIGNALS]), b[Slot.PHASE]
    if waves[count] == time and waves[count + 1] == phase:
        return
    moment = time if phase < 0 else phase
    for k in range(count):
        signal = int(b[Slot.AT_SIGNALS]) + _SIGNAL * k
        value = 0.0
        if b[signal + 1] <= moment < b[signal + 2]:
            if b[signal + 3] < 0:
                value = _straight(b, signal, time)
            elif phase < 0:
                value = _sum(b, signal, time)
            else:
                value = _interpolated(b, signal, int(b[Slot.AT_CELLS]) + _CELL * k, time)
        waves[k] = value
    waves[count], waves[count + 1] = time, phase


# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


_apply = engine_function("mj_applyFT", "void(intp, intp, intp, intp, intp, int32, intp)")
_global = engine_function("mj_local2Global", "void(intp, intp, intp, intp, intp, int32, uint8)")

# constants that compiled code freezes
_FREEDOM, _ACTUATOR, _WIDTH, _PUSH = push_table.FREEDOM, push_table.ACTUATOR, push_table.WIDTH, signals.SIGNAL


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
    at = int(b[Slot.AT_SIGNALS]) + _PUSH * first
    for k in range(first, int(b[Slot.SIGNALS]) - int(b[Slot.SHARES])):
        size, row = waves[k], int(b[Slot.AT_PUSHES]) + _WIDTH * int(b[at])
        at += _PUSH
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


# numba rewrites signatures of intrinsics and calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


_sensor_pos, _sensor_vel = engine_function("mj_sensorPos"), engine_function("mj_sensorVel")

# Constants that compiled code freezes; MuJoCo's layout enters by closure variables instead (see callbacks). Code gone
# stale is caught at start-up by icmj.engine.flow.
_MAGIC, _VERSION, _HEADER, _INPUT = block.MAGIC, block.VERSION, block.HEADER, signals.SIGNAL
_N_DYN, _USER = int(mujoco.mjNDYN), int(mujoco.mjtDyn.mjDYN_USER)
_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)
_lag = compiled(activations.lag)


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
        i = int(b[int(b[Slot.AT_SIGNALS]) + _INPUT * k])
        ctrl[i] -= waves[k] * dot(b[at_K + i * size : at_K + (i + 1) * size], a[:size])


@compiled
def _respond(b, y, ctrl, waves):  # type: ignore[no-untyped-def]
    """Add −S (y + n(t) − y_0) to ``ctrl``."""
    n_y, at_0, at_S, commanded = int(b[Slot.N_Y]), int(b[Slot.AT_Y_0]), int(b[Slot.AT_S]), int(b[Slot.COMMANDED])
    for i in range(int(b[Slot.DIRECT])):
        for j in range(n_y):
            ctrl[i] -= b[at_S + i * n_y + j] * (y[j] - b[at_0 + j])
        signal = int(b[Slot.AT_SIGNALS]) + _INPUT * commanded
        for k in range(commanded, commanded + int(b[Slot.READ])):
            ctrl[i] -= b[at_S + i * n_y + int(b[signal])] * waves[k]
            signal += _INPUT


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
        at += _INPUT
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
            signal = int(b[Slot.AT_SIGNALS]) + _INPUT * commanded
            for k in range(commanded, commanded + int(b[Slot.READ])):
                column = at_N + int(b[signal])
                for i in range(start, end):
                    rate[i] += b[column + i * n_v] * waves[k]
                signal += _INPUT
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
            return rate[first]  # which the engine takes for the rate of one state alone
        # one of the plant's own actuators: a second-order lag, or one that moves as the engine has it
        lags = integers(m, of_model.actuator_dyntype)[actuator] == _USER
        parameters = doubles(m, of_model.actuator_dynprm)[_N_DYN * actuator :]
        if lags and integers(m, of_model.actuator_actnum)[actuator] == 2 and parameters[0] > 0:
            at, u = integers(m, of_model.actuator_actadr)[actuator], doubles(d, of_data.ctrl)[actuator]
            rate[at], rate[at + 1] = _lag(u, act[at], act[at + 1], parameters[0], parameters[1])
        return 0.0

    return control, act_dyn


# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


forward = engine_function("mj_forward")
_forward_skip = engine_function("mj_forwardSkip", "void(intp, intp, int32, int32)")
_kinematics, _com_pos = engine_function("mj_kinematics"), engine_function("mj_comPos")
_camlight, _tendon = engine_function("mj_camlight"), engine_function("mj_tendon")
_make_m, _factor_m = engine_function("mj_makeM"), engine_function("mj_factorM")
_transmission, _fwd_velocity = engine_function("mj_transmission"), engine_function("mj_fwdVelocity")
_fwd_actuation, _fwd_acceleration = engine_function("mj_fwdActuation"), engine_function("mj_fwdAcceleration")
_com_vel, _passive = engine_function("mj_comVel"), engine_function("mj_passive")
_rne = engine_function("mj_rne", "void(intp, intp, int32, intp)")
_solve_m = engine_function("mj_solveM", "void(intp, intp, intp, intp, int32)")
_sense_positions, _sense_velocities = engine_function("mj_sensorPos"), engine_function("mj_sensorVel")

_WHOLE, _PLAIN = int(Stages.WHOLE), int(Stages.PLAIN)


@exact
def flow(engine):  # type: ignore[no-untyped-def]
    """Compute qacc and act_dot at the engine's state and time, and refresh the outputs."""
    if engine.stages == _WHOLE:
        _forward_skip(engine.model, engine.data, 0, 1)
        return
    place(engine)
    if engine.stages == _PLAIN:
        _com_vel(engine.model, engine.data)
        _passive(engine.model, engine.data)
        _rne(engine.model, engine.data, 0, address(engine.bias))
    else:
        _transmission(engine.model, engine.data)
        _fwd_velocity(engine.model, engine.data)
    drive(engine)


@exact
def place(engine):  # type: ignore[no-untyped-def]
    """Compute everything that depends on positions only, except the transmission."""
    _kinematics(engine.model, engine.data)
    _com_pos(engine.model, engine.data)
    if engine.cameras:
        _camlight(engine.model, engine.data)
    if engine.tendons:
        _tendon(engine.model, engine.data)
    _make_m(engine.model, engine.data)
    _factor_m(engine.model, engine.data)


@exact
def drive(engine):  # type: ignore[no-untyped-def]
    """Compute what depends on the controller's state, after the stages of positions and velocities."""
    b, time = engine.block, engine.time[0]
    _sense_positions(engine.model, engine.data)
    if b[Slot.STAGE] >= _VELOCITY:
        _sense_velocities(engine.model, engine.data)
    first = int(b[Slot.ACT])
    waves_at(b, engine.waves, time)
    command(b, engine.act[first:], engine.sensordata, engine.ctrl, engine.waves)
    if b[Slot.PUSHES] > 0:
        moments = engine.rownnz, engine.rowadr, engine.column, engine.value
        push(b, engine.model, engine.data, moments, engine.applied, engine.waves)
    if engine.stages != _PLAIN:
        _fwd_actuation(engine.model, engine.data)
        _fwd_acceleration(engine.model, engine.data)
        for i in range(len(engine.qacc)):
            engine.qacc[i] = engine.qacc_smooth[i]
        return
    rates(b, engine.act[first:], engine.sensordata, engine.act_dot[first:], engine.waves)
    force = engine.force
    for i in range(len(force)):
        force[i] = 0.0
    for k in range(len(engine.moment)):
        force[engine.moment_at[k, 1]] += engine.moment[k] * (engine.gain[k] * engine.ctrl[engine.moment_at[k, 0]])
    for i in range(len(force)):
        force[i] = engine.passive[i] - engine.bias[i] + engine.applied[i] + force[i]
    _solve_m(engine.model, engine.data, address(engine.qacc), address(force), 1)
