"""The motion between events in compiled code: matrices times the state, and the state anywhere on the way."""

from __future__ import annotations

from icmj.base.compilation import compiled, summing
from icmj.linear.native.state import FACTS, Flow

_FACTS = FACTS


@summing
def times(T, z, out):  # type: ignore[no-untyped-def]
    """``out`` := T z."""
    for i in range(T.shape[0]):
        total = 0.0
        for j in range(T.shape[1]):
            total += T[i, j] * z[j]
        out[i] = total


@summing
def dot(row, z):  # type: ignore[no-untyped-def]
    total = 0.0
    for j in range(len(row)):
        total += row[j] * z[j]
    return total


@compiled
def copy(source, to):  # type: ignore[no-untyped-def]
    """As long as ``to`` is."""
    for i in range(len(to)):
        to[i] = source[i]


@compiled
def within(flow, z, theta, result, spare):  # type: ignore[no-untyped-def]
    """``result`` := the state ``theta`` steps after ``z``; more than one goes by whole steps first."""
    P, G, degree = flow.P, flow.G, flow.A.shape[1] - 1
    now, begin = spare[0], spare[1]
    copy(z, result)
    while theta > 1:
        times(P, result, now)
        copy(now, result)
        theta -= 1
    copy(result, begin)
    for j in range(degree, 0, -1):
        times(G, result, now)
        for i in range(len(z)):
            result[i] = begin[i] + theta / j * now[i]


@compiled
def flow_of(plan, m, n_hat, wide, bounds, n_rows, degree):  # type: ignore[no-untyped-def]
    """The matrices of a plan, in their order."""
    at_P = _FACTS
    at_G = at_P + m * m
    at_Q = at_G + m * m
    at_W = at_Q + m * m
    at_V = at_W + m * wide
    at_A = at_V + m * bounds
    at_F = at_A + n_rows * (degree + 1) * m
    at_F2 = at_F + (degree + 1) ** 2
    at_O = at_F2 + (2 * degree + 1) ** 2
    at_X = at_O + m * n_hat
    return Flow(
        plan[at_P:at_G].reshape(m, m),
        plan[at_G:at_Q].reshape(m, m),
        plan[at_Q:at_W].reshape(m, m),
        plan[at_W:at_V].reshape(wide, m),
        plan[at_V:at_A].reshape(bounds, m),
        plan[at_A:at_F].reshape(n_rows, degree + 1, m),
        plan[at_F:at_F2].reshape(degree + 1, degree + 1),
        plan[at_F2:at_O].reshape(2 * degree + 1, 2 * degree + 1),
        plan[at_O:at_X].reshape(n_hat, m),
        plan[at_X : at_X + m * n_hat].reshape(n_hat, m),
    )
