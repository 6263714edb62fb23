"""One step of the engine, which can be undone and repeated with another length."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from numba import types

from icmj.engine.native.compilation import inlined, load_engine
from icmj.engine.native.state import EULER, IMPLICIT, RK4

load_engine()

# pointers travel as integers of their size: the same registers, and no type to convert
_m_d = types.void(types.intp, types.intp)
forward = types.ExternalFunction("mj_forward", _m_d)
_euler = types.ExternalFunction("mj_Euler", _m_d)
_implicit = types.ExternalFunction("mj_implicit", _m_d)
_mj_step = types.ExternalFunction("mj_step", _m_d)
_runge_kutta = types.ExternalFunction("mj_RungeKutta", types.void(types.intp, types.intp, types.int32))


@inlined
def save(engine):  # type: ignore[no-untyped-def]
    """Keep the state that a step begins from."""
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.warmstart):
        for i in range(len(part)):
            engine.saved[at + i] = part[i]
        at += len(part)


@inlined
def _restore(engine, progress):  # type: ignore[no-untyped-def]
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.warmstart):
        for i in range(len(part)):
            part[i] = engine.saved[at + i]
        at += len(part)
    engine.time[0] = progress[0].begin


@inlined
def step(engine, progress, length, first):  # type: ignore[no-untyped-def]
    """One step of the length given from the saved state, and the forward pass at its end."""
    if not first:
        _restore(engine, progress)
        forward(engine.model, engine.data)
    engine.timestep[0] = length
    if engine.integrator == RK4:
        _runge_kutta(engine.model, engine.data, 4)
    elif engine.integrator == EULER:
        _euler(engine.model, engine.data)
    elif engine.integrator == IMPLICIT:
        _implicit(engine.model, engine.data)
    else:
        _mj_step(engine.model, engine.data)
    # not the sum that the engine keeps: its rounding errors add up over many equal steps
    engine.time[0] = progress[0].end if length == progress[0].length else progress[0].begin + length
    forward(engine.model, engine.data)
