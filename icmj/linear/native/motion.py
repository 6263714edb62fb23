"""The motion between events in compiled code: matrices times the state, and the state anywhere on the way."""

from __future__ import annotations

import numpy as np

from icmj.base.compilation import compiled, inlined, summing


@summing
def times(T, s, out):  # type: ignore[no-untyped-def]
    """``out`` := T s."""
    for i in range(T.shape[0]):
        total = 0.0
        for j in range(T.shape[1]):
            total += T[i, j] * s[j]
        out[i] = total


@summing
def dot(row, s):  # type: ignore[no-untyped-def]
    """The product of two vectors, as long as the first."""
    total = 0.0
    for j in range(len(row)):
        total += row[j] * s[j]
    return total


@compiled
def copy(source, to):  # type: ignore[no-untyped-def]
    """As long as ``to`` is."""
    for i in range(len(to)):
        to[i] = source[i]


@compiled
def move(f, by, signals):  # type: ignore[no-untyped-def]
    """Taylor coefficients of polynomials about a place ``by`` steps further on, in place (Horner's scheme)."""
    powers = len(f) // signals if signals > 0 else 0
    for k in range(powers - 1):
        for j in range(powers - 2, k - 1, -1):
            for i in range(signals):
                f[j * signals + i] += by * f[(j + 1) * signals + i]


@inlined
def begin_waves(T, wave, t):  # type: ignore[no-untyped-def]
    """The sinusoids that act from ``t`` on, in the middle of the span that begins there."""
    middle = t + T.steps * T.step / 2
    for k in range(len(T.omega)):
        if T.first[k] <= t < T.last[k]:
            angle = T.omega[k] * middle + T.phase[k]
            wave[0, k], wave[1, k] = np.cos(angle), np.sin(angle)
        else:
            wave[0, k], wave[1, k] = 0.0, 0.0


@inlined
def turn_waves(T, wave):  # type: ignore[no-untyped-def]
    """Every sinusoid a span further on."""
    for k in range(len(T.omega)):
        cos, sin = wave[0, k], wave[1, k]
        wave[0, k] = T.turn[0, k] * cos - T.turn[1, k] * sin
        wave[1, k] = T.turn[1, k] * cos + T.turn[0, k] * sin


@summing
def _product(share, wave, first, last):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(first, last):
        total += share[k] * wave[k]
    return total


@inlined
def expand(T, wave, f):  # type: ignore[no-untyped-def]
    """f about the middle of the span: the j-th derivative of a cosine is one, j quarters of a turn further on."""
    signals = len(T.ranges) - 1
    for j in range(T.share.shape[0]):
        for i in range(signals):
            f[j * signals + i] = _product(T.share[j], wave[j % 2], T.ranges[i], T.ranges[i + 1])


@compiled
def within(P, M, D, degree, s, theta, result, spare):  # type: ignore[no-untyped-def]
    """``result`` := z ``theta`` steps after ``s``, whose f is about its own place; whole steps come first."""
    m, signals = len(result), D.shape[1]
    here, term = spare[0, : len(s)], spare[1, :m]
    copy(s, here)
    while theta > 1:
        times(P, here, term)
        copy(term, here[:m])
        move(here[m:], 1.0, signals)
        theta -= 1
    copy(here, result)
    if signals == 0:
        for j in range(degree, 0, -1):
            times(M, result, term)
            for i in range(m):
                result[i] = here[i] + theta / j * term[i]
        return
    # z_{j+1} = (h M z_j + h D f_j)/(j + 1)
    power = 1.0
    for j in range(degree):
        times(M, here[:m], term)
        if m + (j + 1) * signals <= len(s):
            for k in range(signals):
                for i in range(m):
                    term[i] += D[i, k] * here[m + j * signals + k]
        power *= theta
        for i in range(m):
            here[i] = term[i] / (j + 1)
            result[i] += here[i] * power
