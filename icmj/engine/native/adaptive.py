"""One adaptive step, with the roots and extremes of the polynomials on it.

The first root of the event function, which is a polynomial on each adaptive step.

Extremes of smooth signals between their samples.

One adaptive step: its stages, its error, its dense output, and where the event function reaches zero in it.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np

from icmj.base.array import Array, from_powers
from icmj.base.compilation import call
from icmj.base.roots import DEEPEST, evaluate, first_root
from icmj.engine import schedule
from icmj.engine.native.field import flow, look
from icmj.engine.native.memory import address, allocating, compiled, engine_function, entry, exact, inlined, sources
from icmj.engine.schedule import POWER

DEGREE = 2 * POWER
_DEGREE, _POWER = DEGREE, POWER


class Roots(NamedTuple):
    """Work arrays of the search for the event function's first root.

    Attributes:
        to_bernstein: from power to Bernstein coefficients, shape (15, 15).
        row, powers: coefficients of a row of R a(θ), (8,), and of E, (15,).
        stack, spans: as :mod:`icmj.base.roots` has them, shapes (56, 15), (56, 3).
    """

    to_bernstein: Array
    row: Array
    powers: Array
    stack: Array
    spans: Array


def roots() -> Roots:
    """The work arrays for one loop."""
    return Roots(
        np.ascontiguousarray(from_powers(DEGREE)), np.zeros(POWER + 1), np.zeros(DEGREE + 1),
        np.zeros((DEEPEST, DEGREE + 1)), np.zeros((DEEPEST, 3)),
    )  # fmt: skip


@compiled
def event_in(r, stepper, rule, first, at):  # type: ignore[no-untyped-def]
    """Where in the step, from the fraction ``at`` on, the event function first reaches zero; −1 if it had before.

    ``first`` is where the controller's states begin in the state. Infinity where it does not reach zero.
    """
    found = np.inf
    for face in range(len(rule.cuts) - 1):
        for j in range(_DEGREE + 1):
            r.powers[j] = 0.0
        r.powers[0] = -1.0
        for k in range(rule.cuts[face], rule.cuts[face + 1]):
            p = r.row
            for j in range(_POWER + 1):
                p[j] = 0.0
            for i in range(rule.spans[k, 0], rule.spans[k, 1]):
                p[0] += rule.R[k, i] * stepper.start[first + i]
            for m in range(_POWER):
                part = 0.0
                for i in range(rule.spans[k, 0], rule.spans[k, 1]):
                    part += rule.R[k, i] * stepper.F[m, first + i]
                for j in range(m + 2):
                    p[j] += part * stepper.powers[m, j]
            for i in range(_POWER + 1):
                for j in range(_POWER + 1):
                    r.powers[i + j] += p[i] * p[j]
        if at > 0 and evaluate(r.powers, _DEGREE, at) >= 0:
            return -1.0
        if at < 1:
            found = min(found, first_root(r.powers, _DEGREE, r.to_bernstein, r.stack, r.spans, at))
    return found


@compiled
def _peak(s, z, c):  # type: ignore[no-untyped-def]
    """Maximum near the highest point of the polynomial through (s, z); ``c`` is scratch of the same length."""
    size = len(s)
    top = 0
    for i in range(size):
        c[i] = z[i]
        if z[i] > z[top]:
            top = i
    # Newton's divided differences, then the coefficients of the powers (Björck and Pereyra)
    for k in range(size - 1):
        for i in range(size - 1, k, -1):
            c[i] = (c[i] - c[i - 1]) / (s[i] - s[i - k - 1])
    for k in range(size - 2, -1, -1):
        for i in range(k, size - 1):
            c[i] -= c[i + 1] * s[k]
    low, high = s[max(top - 1, 0)], s[min(top + 1, size - 1)]
    at, value = s[top], 0.0
    for _ in range(9):
        value, d1, d2 = 0.0, 0.0, 0.0
        for i in range(size - 1, -1, -1):
            d2 = d2 * at + 2 * d1
            d1 = d1 * at + value
            value = value * at + c[i]
        if d2 < 0:
            at = min(max(at - d1 / d2, low), high)
    return max(value, z[top])


@allocating
def _find(t, y, high, low, points):  # type: ignore[no-untyped-def]
    gap = 0.05 * (t[-1] - t[0]) / max(len(t) - 1, 1)
    kept = np.empty(len(t), np.int64)
    n = 0
    for i in range(len(t)):
        inside = 0 < i < len(t) - 1
        if not inside or min(t[i] - t[i - 1], t[i + 1] - t[i]) > gap:
            kept[n] = i
            n += 1
    size = min(points, n)
    s, z, c = np.empty(size), np.empty(size), np.empty(size)
    for column in range(y.shape[1]):
        top, bottom = -np.inf, np.inf
        for i in range(len(t)):
            top, bottom = max(top, y[i, column]), min(bottom, y[i, column])
        for i in range(1, n - 1):
            before, here, after = y[kept[i - 1], column], y[kept[i], column], y[kept[i + 1], column]
            for sign in (1.0, -1.0):
                peak = sign * here >= sign * before and sign * here >= sign * after
                peak = peak or (i == 1 and sign * before > sign * here)
                peak = peak or (i == n - 2 and sign * after > sign * here)
                if peak:
                    first = min(max(i - size // 2, 0), n - size)
                    begin, scale = t[kept[first]], (t[kept[first + size - 1]] - t[kept[first]]) / 2
                    for j in range(size):
                        s[j] = (t[kept[first + j]] - begin) / scale - 1
                        z[j] = sign * y[kept[first + j], column]
                    value = sign * _peak(s, z, c)
                    top, bottom = max(top, value), min(bottom, value)
        high[column], low[column] = top, bottom


@cache
def _entry() -> Any:
    source = sources()

    @entry
    def find(t, y, cuts, high, low, points):  # type: ignore[no-untyped-def]
        if source:
            top, bottom = np.empty(len(high)), np.empty(len(low))
            for k in range(len(cuts) - 1):
                _find(t[cuts[k] : cuts[k + 1] + 1], y[cuts[k] : cuts[k + 1] + 1], top, bottom, points)
                for i in range(len(high)):
                    high[i] = top[i] if k == 0 else max(high[i], top[i])
                    low[i] = bottom[i] if k == 0 else min(low[i], bottom[i])

    return find


def extremes(t: Array, y: Array, points: int, cuts: np.ndarray | None = None) -> tuple[Array, Array]:
    """Largest and smallest value of each signal y(t), between samples too, smooth but at the samples of ``cuts``.

    Around every sample that is higher (lower) than its neighbours the polynomial through the ``points`` nearest
    samples is maximised; the ends of the span count as they are. Samples much closer together than the others are
    thinned, for a polynomial through them would magnify rounding. Shapes (M,), (M, n) → (n,), (n,). The numbers in
    ``cuts`` rise from 0 to M − 1, which is what they are by default.
    """
    cuts = np.array([0, len(t) - 1]) if cuts is None else cuts
    high, low = np.empty(y.shape[1]), np.empty(y.shape[1])
    # contiguous: for every other layout numba would compile once more
    call(_entry(), np.ascontiguousarray(t), np.ascontiguousarray(y), cuts, high, low, points)
    return high, low


# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"


_normalize_quat = engine_function("mj_normalizeQuat")

# constants that compiled code freezes
_STEP_POWER, _WITHIN, _LAST = schedule.POWER, schedule.WITHIN, schedule.LAST


class Stepper(NamedTuple):
    """The method's coefficients and the work arrays of a step.

    Attributes:
        A, c, E3, E5, D, powers, last, rates, looks, exponent, allowed: of the method; see
            :class:`icmj.engine.schedule.Tableau`.
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


def stepper_of(model: mujoco.MjModel, qpos_0: Array, method: schedule.Tableau) -> Stepper:
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
        single, quadruple, origin, start, end, reach, room, np.zeros((schedule.RATES, n)), np.zeros((_STEP_POWER, n)),
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
        error = abs(_LAST * stepper.F[_STEP_POWER - 1, i]) / (_WITHIN * _scale(stepper, i, tolerance))
        if not np.isfinite(error):
            return np.inf
        most = max(most, error)
    return most


@exact
def interpolate(stepper, theta):  # type: ignore[no-untyped-def]
    """The state at the fraction ``theta`` of the step, from its dense output, into ``stepper.room``."""
    for i in range(len(stepper.room)):
        value = 0.0
        for k in range(_STEP_POWER - 1, -1, -1):
            value = (value + stepper.F[k, i]) * (theta if k % 2 == 0 else 1 - theta)
        stepper.room[i] = stepper.start[i] + value


@exact
def look_within(engine, stepper, theta, t):  # type: ignore[no-untyped-def]
    """Move the engine to the fraction ``theta`` of the step, and compute its outputs there."""
    interpolate(stepper, theta)
    put(engine, stepper.room, t)
    normalise(engine, stepper)
    look(engine)
