"""The rates of plant, observer and hold where the engine is, from as few of its stages as give them to the last bit."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import mujoco
from numba import types

from icmj.engine.block import Slot
from icmj.engine.native.callbacks import command, rates, waves_at
from icmj.engine.native.compilation import exact, load_engine
from icmj.engine.native.pushing import push
from icmj.engine.stages import Stages

load_engine()

# pointers travel as integers of their size: the same registers, and no type to convert
_m_d = types.void(types.intp, types.intp)
forward = types.ExternalFunction("mj_forward", _m_d)
_forward_skip = types.ExternalFunction("mj_forwardSkip", types.void(types.intp, types.intp, types.int32, types.int32))
_kinematics = types.ExternalFunction("mj_kinematics", _m_d)
_com_pos = types.ExternalFunction("mj_comPos", _m_d)
_camlight = types.ExternalFunction("mj_camlight", _m_d)
_tendon = types.ExternalFunction("mj_tendon", _m_d)
_make_m = types.ExternalFunction("mj_makeM", _m_d)
_factor_m = types.ExternalFunction("mj_factorM", _m_d)
_transmission = types.ExternalFunction("mj_transmission", _m_d)
_fwd_velocity = types.ExternalFunction("mj_fwdVelocity", _m_d)
_fwd_actuation = types.ExternalFunction("mj_fwdActuation", _m_d)
_fwd_acceleration = types.ExternalFunction("mj_fwdAcceleration", _m_d)
_com_vel = types.ExternalFunction("mj_comVel", _m_d)
_passive = types.ExternalFunction("mj_passive", _m_d)
_rne = types.ExternalFunction("mj_rne", types.void(types.intp, types.intp, types.int32, types.intp))
_solve_m = types.ExternalFunction("mj_solveM", types.void(types.intp, types.intp, types.intp, types.intp, types.int32))
_sensor_pos = types.ExternalFunction("mj_sensorPos", _m_d)
_sensor_vel = types.ExternalFunction("mj_sensorVel", _m_d)

_WHOLE, _PLAIN = int(Stages.WHOLE), int(Stages.PLAIN)
_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)


@exact
def flow(engine):  # type: ignore[no-untyped-def]
    """qacc and act_dot of the state and time that the engine is at; the outputs are refreshed with them."""
    if engine.stages == _WHOLE:
        _forward_skip(engine.model, engine.data, 0, 1)
        return
    place(engine)
    if engine.stages == _PLAIN:
        _com_vel(engine.model, engine.data)
        _passive(engine.model, engine.data)
        _rne(engine.model, engine.data, 0, engine.bias.ctypes.data)
    else:
        _transmission(engine.model, engine.data)
        _fwd_velocity(engine.model, engine.data)
    drive(engine)


@exact
def place(engine):  # type: ignore[no-untyped-def]
    """Everything that follows from the positions, but the transmission."""
    _kinematics(engine.model, engine.data)
    _com_pos(engine.model, engine.data)
    if engine.cameras:
        _camlight(engine.model, engine.data)
    if engine.tendons:
        _tendon(engine.model, engine.data)
    _make_m(engine.model, engine.data)
    _factor_m(engine.model, engine.data)


@exact
def look(engine):  # type: ignore[no-untyped-def]
    """The outputs at the state that the engine is at, and nothing else."""
    if engine.stages == _WHOLE:
        forward(engine.model, engine.data)
        return
    _kinematics(engine.model, engine.data)
    _com_pos(engine.model, engine.data)
    if engine.cameras:
        _camlight(engine.model, engine.data)
    if engine.tendons:
        _tendon(engine.model, engine.data)
    moving = engine.block[Slot.STAGE] >= _VELOCITY
    if engine.stages != _PLAIN:
        _transmission(engine.model, engine.data)
        if moving:
            _fwd_velocity(engine.model, engine.data)
    elif moving:
        _com_vel(engine.model, engine.data)
    _sensor_pos(engine.model, engine.data)
    if moving:
        _sensor_vel(engine.model, engine.data)


@exact
def drive(engine):  # type: ignore[no-untyped-def]
    """What follows from the controller's state, where the plant's positions and velocities have been seen to."""
    b, time = engine.block, engine.time[0]
    _sensor_pos(engine.model, engine.data)
    if b[Slot.STAGE] >= _VELOCITY:
        _sensor_vel(engine.model, engine.data)
    first = int(b[Slot.ACT])
    waves_at(b, engine.waves, time)
    command(b, engine.act[first:], engine.ctrl, engine.waves)
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
    _solve_m(engine.model, engine.data, engine.qacc.ctypes.data, force.ctypes.data, 1)
