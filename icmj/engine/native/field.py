"""The rates of plant, observer and hold at the engine's state, from the fewest stages that give identical results."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import mujoco

from icmj.engine.block import Slot
from icmj.engine.native.callbacks import command, rates
from icmj.engine.native.compilation import engine_function, exact
from icmj.engine.native.memory import address
from icmj.engine.native.pushing import push
from icmj.engine.native.waves import waves_at
from icmj.engine.stages import Stages

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
_sensor_pos, _sensor_vel = engine_function("mj_sensorPos"), engine_function("mj_sensorVel")

_WHOLE, _PLAIN = int(Stages.WHOLE), int(Stages.PLAIN)
_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)


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
def look(engine):  # type: ignore[no-untyped-def]
    """Compute the outputs at the engine's state, and nothing else."""
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
    """Compute what depends on the controller's state, after the stages of positions and velocities."""
    b, time = engine.block, engine.time[0]
    _sensor_pos(engine.model, engine.data)
    if b[Slot.STAGE] >= _VELOCITY:
        _sensor_vel(engine.model, engine.data)
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
