"""Exogenous signals at an instant, in the loops and callbacks; see :mod:`icmj.engine.signals`."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

import numpy as np

from icmj.engine import signals
from icmj.engine.block import Slot
from icmj.engine.native.compilation import compiled, exact

# constants that compiled code freezes
_SIGNAL, _WEIGHTS, _CELL, _PLACE = signals.SIGNAL, signals.WEIGHTS, signals.CELL, signals.PLACE
_HALF, _KEPT, _GROUP = signals.HALF, signals.KEPT, signals.GROUP


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
