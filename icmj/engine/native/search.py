"""Whether the event function reaches zero within a step, and where."""

from __future__ import annotations

import numpy as np

from icmj.engine.native.compilation import compiled, inlined
from icmj.engine.native.step import step, undo
from icmj.engine.schedule import EVENT_TOLERANCE

_TOLERANCE = EVENT_TOLERANCE
_SPLITS = 64  # finest division of a step in which E is looked at before a near-touch counts as none


@inlined
def evaluate(rule):  # type: ignore[no-untyped-def]
    """Write (E_j, dE_j/dt) of every face at the engine's state, after a forward pass, into ``rule.now``."""
    for face in range(len(rule.now)):
        E, dE = -1.0, 0.0
        for row in range(rule.cuts[face], rule.cuts[face + 1]):
            value, rate = 0.0, 0.0
            for i in range(rule.spans[row, 0], rule.spans[row, 1]):
                value += rule.R[row, i] * rule.a[i]
                rate += rule.R[row, i] * rule.a_rate[i]
            E += value * value
            dE += 2 * value * rate
        rule.now[face, 0], rule.now[face, 1] = E, dE


@inlined
def active(levels):  # type: ignore[no-untyped-def]
    """The face with the largest E_j; −1 where one is not finite, or there is none."""
    best = -1
    for face in range(len(levels)):
        if not np.isfinite(levels[face, 0]):
            return -1
        if best < 0 or levels[face, 0] > levels[best, 0]:
            best = face
    return best


@inlined
def reached(levels):  # type: ignore[no-untyped-def]
    """Whether the event function has reached zero."""
    face = active(levels)
    return face >= 0 and levels[face, 0] >= 0


@inlined
def copy(source, target):  # type: ignore[no-untyped-def]
    """Copy the levels (E_j, dE_j/dt) of one point to another."""
    for face in range(len(source)):
        target[face, 0], target[face, 1] = source[face, 0], source[face, 1]


@inlined
def _may_reach_zero(E_0, dE_0, E_1, dE_1, length, margin):  # type: ignore[no-untyped-def]
    """Whether E, negative at the start, may reach zero *inside* the step and fall again, with E and dE/dt at both ends.

    The cubic Hermite interpolant H(s) = E_0 + dE_0 s + c s² + d s³ stands for E, allowing for ``margin`` of error. Of
    its two stationary points the maximum is where H'' = −2 √disc; the forms of the root below do not cancel.
    """
    c = (3 * (E_1 - E_0) / length - 2 * dE_0 - dE_1) / length
    d = (dE_0 + dE_1 - 2 * (E_1 - E_0) / length) / length**2
    disc = c * c - 3 * d * dE_0
    if disc <= 0:
        return False
    root = np.sqrt(disc)
    if c < 0:
        s = dE_0 / (root - c)
    elif d != 0:
        s = (-c - root) / (3 * d)
    else:
        return False
    if not 0 < s < length:
        return False
    return E_0 + s * (dE_0 + s * (c + s * d)) + margin >= 0


@inlined
def may_reach_zero(before, after, top, length, margin):  # type: ignore[no-untyped-def]
    """Whether any face's E_j may reach zero inside; ``top`` holds the larger |E_j + 1| of the step's ends."""
    for j in range(len(before)):
        if _may_reach_zero(before[j, 0], before[j, 1], after[j, 0], after[j, 1], length, margin * top[j]):
            return True
    return False


@inlined
def margin(rate, length):  # type: ignore[no-untyped-def]
    """How far E_j + 1 may leave its cubic Hermite interpolant within a step, relative to its value at the ends.

    E_j + 1 = |R_j a|² is a sum of exponentials with rates up to twice the loop's, and a Hermite cubic errs by
    h⁴/384 times the fourth derivative; the factor 10 is for what the nonlinear plant adds.
    """
    return 10 * (2 * rate * length) ** 4 / 384


@compiled
def _hermite_root(low, E_l, dE_l, high, E_h, dE_h):  # type: ignore[no-untyped-def]
    """Root of the cubic Hermite interpolant of E between ``low`` (E < 0) and ``high`` (E ≥ 0)."""
    length = high - low
    c = (3 * (E_h - E_l) / length - 2 * dE_l - dE_h) / length
    d = (dE_l + dE_h - 2 * (E_h - E_l) / length) / length**2
    a, b = 0.0, length
    s = length * E_l / (E_l - E_h)
    for _ in range(50):
        value = E_l + s * (dE_l + s * (c + s * d))
        if value >= 0:
            b = s
        else:
            a = s
        slope = dE_l + s * (2 * c + s * 3 * d)
        new = s - value / slope if slope > 0 else -1.0
        if not a < new < b:
            new = (a + b) / 2
        if abs(new - s) <= 1e-15 * length:
            break
        s = new
    return low + max(s, 1e-3 * _TOLERANCE)


@compiled
def locate(engine, progress, rule, low, at_low, high):  # type: ignore[no-untyped-def]
    """Find the root of max E_j between ``low`` (all negative) and ``high`` (where the engine is; one is not)."""
    now = rule.now
    s = np.inf
    for j in range(len(now)):
        if now[j, 0] >= 0:
            s = min(s, _hermite_root(low, at_low[j, 0], at_low[j, 1], high, now[j, 0], now[j, 1]))
    for trial in range(60):
        undo(engine, progress)
        step(engine, progress, s)
        evaluate(rule)
        face = active(now)
        E, dE = now[face, 0], now[face, 1]
        if E >= 0:
            high = s
        else:
            low = s
        newton = s - E / dE if dE > 0 else np.inf
        if abs(newton - s) <= _TOLERANCE or high - low <= _TOLERANCE:
            break
        s = newton if low < newton < high and trial % 8 != 7 else (low + high) / 2


@compiled
def search(engine, progress, rule, rate, length):  # type: ignore[no-untyped-def]
    """Search for an event inside the last step by bisection; leaves the state at the event, or at the step's end."""
    pieces = 2
    while pieces <= _SPLITS:
        s_a = 0.0
        copy(rule.before, rule.left)
        allowed = margin(rate, length / pieces)
        settled = True
        for j in range(1, pieces + 1):
            s_b = length * j / pieces
            undo(engine, progress)
            step(engine, progress, s_b)
            evaluate(rule)
            if rule.now[active(rule.now), 0] >= 0:
                locate(engine, progress, rule, s_a, rule.left, s_b)
                return True
            settled = settled and not may_reach_zero(rule.left, rule.now, rule.top, s_b - s_a, allowed)
            s_a = s_b
            copy(rule.now, rule.left)
        if settled:
            break
        pieces *= 2
    return False
