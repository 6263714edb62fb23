"""One step of the engine, which can be undone and repeated with another length."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from icmj.engine.native.compilation import compiled, engine_function, exact
from icmj.engine.native.field import drive, flow, forward
from icmj.engine.native.state import EULER, IMPLICIT, RK4
from icmj.engine.stages import Stages

_euler, _implicit, _mj_step = (engine_function(f"mj_{name}") for name in ("Euler", "implicit", "step"))
_runge_kutta = engine_function("mj_RungeKutta", "void(intp, intp, int32)")

_WHOLE = int(Stages.WHOLE)


@exact
def save(engine):  # type: ignore[no-untyped-def]
    """Save the state at the start of a step, and its rates."""
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.warmstart):
        for i in range(len(part)):
            engine.saved[at + i] = part[i]
        at += len(part)
    keep_rates(engine, engine.k[0])


@exact
def keep_rates(engine, k):  # type: ignore[no-untyped-def]
    """Save (qvel, qacc, act_dot) at the engine's state."""
    at = 0
    for part in (engine.qvel, engine.qacc, engine.act_dot):
        for i in range(len(part)):
            k[at + i] = part[i]
        at += len(part)


@exact
def _restore(engine, progress):  # type: ignore[no-untyped-def]
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act, engine.warmstart):
        for i in range(len(part)):
            part[i] = engine.saved[at + i]
        at += len(part)
    engine.time[0] = progress[0].begin


@compiled
def _lean_runge_kutta(engine, progress, length, end):  # type: ignore[no-untyped-def]
    """mj_RungeKutta from the saved state, and the rates at its end: the same operations in the same order.

    For hinges and slides, whose positions move as vectors do.
    """
    k, saved = engine.k, engine.saved
    nv, na = len(engine.qvel), len(engine.act)
    for stage in range(1, 5):
        sum = engine.sum
        for i in range(2 * nv + na):
            if stage < 3:
                sum[i] = k[stage - 1, i] * 0.5
            elif stage == 3:
                sum[i] = k[2, i]
            else:
                sum[i] = k[0, i] * (1 / 6) + k[1, i] * (1 / 3) + k[2, i] * (1 / 3) + k[3, i] * (1 / 6)
        for i in range(nv):
            engine.qpos[i] = saved[i] + sum[i] * length
            engine.qvel[i] = saved[nv + i] + sum[nv + i] * length
        for i in range(na):
            engine.act[i] = saved[2 * nv + i] + sum[2 * nv + i] * length
        if stage == 4:
            engine.time[0] = end
        else:
            engine.time[0] = progress[0].begin + (0.5 * length if stage < 3 else length)
        flow(engine)
        if stage < 4:
            keep_rates(engine, k[stage])


@exact
def undo(engine, progress):  # type: ignore[no-untyped-def]
    """Restore the saved state, to take another step from it."""
    if engine.integrator != RK4 or engine.stages == _WHOLE:
        _restore(engine, progress)
        forward(engine.model, engine.data)


@exact
def step(engine, progress, length):  # type: ignore[no-untyped-def]
    """One step of the length given from the saved state, and the forward pass at its end."""
    # not the sum that the engine keeps: its rounding errors add up over many equal steps
    end = progress[0].end if length == progress[0].length else progress[0].begin + length
    if engine.integrator == RK4 and engine.stages != _WHOLE:
        _lean_runge_kutta(engine, progress, length, end)
        return
    engine.timestep[0] = length
    if engine.integrator == RK4:
        _runge_kutta(engine.model, engine.data, 4)
    elif engine.integrator == EULER:
        _euler(engine.model, engine.data)
    elif engine.integrator == IMPLICIT:
        _implicit(engine.model, engine.data)
    else:
        _mj_step(engine.model, engine.data)
    engine.time[0] = end
    forward(engine.model, engine.data)


@compiled
def refresh(engine):  # type: ignore[no-untyped-def]
    """Recompute the rates after a change of the controller's state or of a disturbance."""
    if engine.stages == _WHOLE:
        forward(engine.model, engine.data)
    else:
        drive(engine)
