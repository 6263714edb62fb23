"""One adaptive step: its stages, its error, its dense output, and where the event function reaches zero in it."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine import tableau
from icmj.engine.native.compilation import compiled, engine_function, exact, inlined
from icmj.engine.native.field import flow, look
from icmj.engine.native.memory import address

_normalize_quat = engine_function("mj_normalizeQuat")

# constants that compiled code freezes
_POWER, _WITHIN, _LAST = tableau.POWER, tableau.WITHIN, tableau.LAST


class Stepper(NamedTuple):
    """The method's coefficients and the work arrays of a step.

    Attributes:
        A, c, E3, E5, D, powers, last, rates, looks, exponent, allowed: of the method; see
            :class:`icmj.engine.tableau.Tableau`.
        scalars, quaternions: (address in qpos, address in qvel) of hinges, slides and translations, and of rotations.
        origin: the state that departures are counted from, shape (n,).
        start, end, reach, rate: states at the step's ends; largest departures since the last event; room; (n,).
        K: rates at the stages, shape (16, n).
        kept: rates at the begin of a step that ends at an event, (n,).
        F: vectors of the dense output, shape (7, n).
        y: outputs at the step's end.
        passes: how often the engine has been asked for rates, shape (1,).
        apart: whether rows are no samples of the outputs, for a controller that reads these: what is recorded must not
            change what it reads.
    """

    A: Array
    c: Array
    E3: Array
    E5: Array
    D: Array
    powers: Array
    last: int
    rates: int
    looks: int
    exponent: float
    allowed: float
    scalars: np.ndarray
    quaternions: np.ndarray
    origin: Array
    start: Array
    end: Array
    reach: Array
    room: Array
    K: Array
    F: Array
    y: Array
    passes: np.ndarray
    apart: bool


def stepper_of(model: mujoco.MjModel, qpos_0: Array, method: tableau.Tableau) -> Stepper:
    """The stepper of a model with its work arrays."""
    n = model.nq + model.nv + model.na
    scalars, quaternions = [], []
    for kind, q, v in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
        free = mujoco.mjtJoint(kind) == mujoco.mjtJoint.mjJNT_FREE
        if free:
            scalars += [(q + i, v + i) for i in range(3)]
        if free or mujoco.mjtJoint(kind) == mujoco.mjtJoint.mjJNT_BALL:
            quaternions.append((q + 3 * free, v + 3 * free))
        else:
            scalars.append((q, v))
    origin = np.zeros(n)
    origin[: model.nq] = qpos_0
    single, quadruple = (np.array(found, dtype=np.int64).reshape(-1, 2) for found in (scalars, quaternions))
    start, end, reach, room = (np.zeros(n) for _ in range(4))
    return Stepper(
        method.A, method.c, method.E3, method.E5, method.D, method.powers,
        method.stages, method.rates, method.looks, method.exponent, method.allowed,
        single, quadruple, origin, start, end, reach, room, np.zeros((tableau.RATES, n)), np.zeros((_POWER, n)),
        np.zeros(model.nsensordata), np.zeros(1, dtype=np.int64), False,
    )  # fmt: skip


@exact
def get(engine, state):  # type: ignore[no-untyped-def]
    """Copy the engine's state (qpos, qvel, act)."""
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act):
        for i in range(len(part)):
            state[at + i] = part[i]
        at += len(part)


@exact
def put(engine, state, t):  # type: ignore[no-untyped-def]
    """Move the engine to a state and a time."""
    at = 0
    for part in (engine.qpos, engine.qvel, engine.act):
        for i in range(len(part)):
            part[i] = state[at + i]
        at += len(part)
    engine.time[0] = t


@exact
def rates_at(engine, stepper, K):  # type: ignore[no-untyped-def]
    """Rates of the state, from the results of a forward pass."""
    for k in range(len(stepper.scalars)):
        K[stepper.scalars[k, 0]] = engine.qvel[stepper.scalars[k, 1]]
    for k in range(len(stepper.quaternions)):
        q, v = stepper.quaternions[k, 0], stepper.quaternions[k, 1]
        w, x, y, z = engine.qpos[q], engine.qpos[q + 1], engine.qpos[q + 2], engine.qpos[q + 3]
        a, b, c = engine.qvel[v], engine.qvel[v + 1], engine.qvel[v + 2]
        K[q] = 0.5 * (-x * a - y * b - z * c)
        K[q + 1] = 0.5 * (w * a - z * b + y * c)
        K[q + 2] = 0.5 * (z * a + w * b - x * c)
        K[q + 3] = 0.5 * (-y * a + x * b + w * c)
    at = len(engine.qpos)
    for part in (engine.qacc, engine.act_dot):
        for i in range(len(part)):
            K[at + i] = part[i]
        at += len(part)


@exact
def normalise(engine, stepper):  # type: ignore[no-untyped-def]
    """Quaternions of unit length."""
    if len(stepper.quaternions) > 0:
        _normalize_quat(engine.model, address(engine.qpos))


@compiled
def pass_at(engine, stepper):  # type: ignore[no-untyped-def]
    """Evaluate the rates at the engine's state, as the first stage of the next step."""
    flow(engine)
    stepper.passes[0] += 1
    rates_at(engine, stepper, stepper.K[0])


@compiled
def stages(engine, stepper, t, step, first, last):  # type: ignore[no-untyped-def]
    """Rates of the stages from ``first`` to ``last``, the one numbered ``stepper.last`` at the step's end."""
    K, A, state = stepper.K, stepper.A, stepper.room
    n = len(state)
    for stage in range(first, last + 1):
        for i in range(n):
            state[i] = 0.0
        for j in range(stage):
            a = A[stage, j]
            if a != 0:
                for i in range(n):
                    state[i] += a * K[j, i]
        for i in range(n):
            state[i] = stepper.start[i] + step * state[i]
        put(engine, state, t + stepper.c[stage] * step)
        flow(engine)
        stepper.passes[0] += 1
        rates_at(engine, stepper, K[stage])
        if stage == stepper.last:
            for i in range(n):
                stepper.end[i] = state[i]
            for i in range(len(stepper.y)):
                stepper.y[i] = engine.sensordata[i]


@inlined
def _scale(stepper, i, tolerance):  # type: ignore[no-untyped-def]
    """What the tolerance is of a component of the state: relative to its largest departure, above rounding."""
    far = max(abs(stepper.start[i] - stepper.origin[i]), abs(stepper.end[i] - stepper.origin[i]))
    reach = max(stepper.reach[i], far)
    return tolerance * (reach + 1e-14 / tolerance * (1 + abs(stepper.start[i])))


@compiled
def error_of(stepper, step, tolerance):  # type: ignore[no-untyped-def]
    """The estimated error of a step relative to the tolerance, root mean square over the state."""
    n = len(stepper.start)
    e5, e3 = 0.0, 0.0
    for i in range(n):
        scale = stepper.allowed * _scale(stepper, i, tolerance)
        a, b = 0.0, 0.0
        for j in range(stepper.last + 1):
            a += stepper.E5[j] * stepper.K[j, i]
            b += stepper.E3[j] * stepper.K[j, i]
        e5 += (a / scale) ** 2
        e3 += (b / scale) ** 2
    e5, e3 = e5 / n, e3 / n
    return abs(step) * e5 / np.sqrt(e5 + 0.01 * e3) if e5 + e3 > 0 else 0.0 * (e5 + e3)


@compiled
def accept(stepper):  # type: ignore[no-untyped-def]
    """Update the largest magnitudes of the state so far, which scale the relative tolerance."""
    for i in range(len(stepper.start)):
        far = max(abs(stepper.start[i] - stepper.origin[i]), abs(stepper.end[i] - stepper.origin[i]))
        stepper.reach[i] = max(stepper.reach[i], far)


@compiled
def densify(stepper, step):  # type: ignore[no-untyped-def]
    """The vectors of the dense output, from all rates of the step."""
    K, F = stepper.K, stepper.F
    n = len(stepper.start)
    for i in range(n):
        moved = stepper.end[i] - stepper.start[i]
        F[0, i] = moved
        F[1, i] = step * K[0, i] - moved
        F[2, i] = 2 * moved - step * (K[stepper.last, i] + K[0, i])
    for k in range(4):
        for i in range(n):
            F[3 + k, i] = 0.0
        for j in range(stepper.rates):
            d = stepper.D[k, j]
            if d != 0:
                for i in range(n):
                    F[3 + k, i] += d * K[j, i]
        for i in range(n):
            F[3 + k, i] *= step


@compiled
def error_within(stepper, tolerance):  # type: ignore[no-untyped-def]
    """The estimated error of the dense output relative to the tolerance, the largest of the state."""
    most = 0.0
    for i in range(len(stepper.start)):
        error = abs(_LAST * stepper.F[_POWER - 1, i]) / (_WITHIN * _scale(stepper, i, tolerance))
        if not np.isfinite(error):
            return np.inf
        most = max(most, error)
    return most


@exact
def interpolate(stepper, theta):  # type: ignore[no-untyped-def]
    """The state at the fraction ``theta`` of the step, from its dense output, into ``stepper.room``."""
    for i in range(len(stepper.room)):
        value = 0.0
        for k in range(_POWER - 1, -1, -1):
            value = (value + stepper.F[k, i]) * (theta if k % 2 == 0 else 1 - theta)
        stepper.room[i] = stepper.start[i] + value


@exact
def look_within(engine, stepper, theta, t):  # type: ignore[no-untyped-def]
    """Move the engine to the fraction ``theta`` of the step, and compute its outputs there."""
    interpolate(stepper, theta)
    put(engine, stepper.room, t)
    normalise(engine, stepper)
    look(engine)
