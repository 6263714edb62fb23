"""The controller's block in a composed model: one ``<numeric>``, described here for both Python and compiled code.

It begins with a header of numbers by :class:`Slot`; then come the parts of :data:`PARTS`, row by row, each where the
header says. Whoever writes or reads it goes by these two names, so a further part or number is declared here and
nowhere else. ``segments`` and ``span_K`` say which columns of the rows of each segment of the state are not all zero,
so that compiled code skips the others.

The *phase time* says which disturbance windows are open: a loop that splits its steps at the windows' edges sets it
to a time between two edges, so that a step ending on an edge still sees the value before it in its last stage. While
it is negative the windows follow the model's own time.

What acts from outside is looked up in *cells* (:mod:`icmj.engine.signals`), which a loop fills here as it comes to
them. They hold nothing but what follows from the terms, and nobody reads them while the phase time is negative: then
the model may be in other hands, in several threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import prod

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.controller.realisation import Realisation
from icmj.engine.push_table import WIDTH
from icmj.engine.signals import (
    CELL,
    FOREVER,
    SIGNAL,
    WEIGHTS,
    compute_weights,
    draw_signals,
    list_signals,
    make_cells,
    sort_terms,
)
from icmj.simulation.disturbance import Disturbance
from icmj.simulation.sources import Gridded

GROUP = 16  # cells whose phases follow from each other


MAGIC = 20170508228.0
VERSION = 10.0


class Slot(IntEnum):
    """Places in the header."""

    MAGIC = 0
    VERSION = 1
    SIZE = 2  # states of the controller, N_a
    N_U = 3
    N_Y = 4
    ROWS = 5  # of R
    FACES = 6
    TERMS = 7  # of the disturbance
    SEGMENTS = 8  # of the controller's states
    ACT = 9  # where the controller's states begin in ``act``
    STAGE = 10  # last sensor stage needed (1 position, 2 velocity)
    PHASE = 11  # the phase time [s]
    AT_M = 12  # from here on: where each part begins, counted from the header's start
    AT_N = 13
    AT_K = 14
    AT_J = 15
    AT_G = 16
    AT_R = 17
    AT_CUTS = 18
    AT_SEGMENTS = 19
    AT_SPAN_K = 20
    AT_Y_0 = 21
    AT_CTRL_0 = 22
    AT_TERMS = 23
    ERRORS = 24  # terms of the outputs' errors
    AT_ERRORS = 25
    PUSHES = 26  # places where something acts on the plant itself
    AT_PUSHES = 27
    SIZES = 28  # terms of how large it is there
    AT_SIZES = 29
    SIGNALS = 30  # sums of the terms that act in one place at one time: beside commands, errors, sizes, shares
    AT_SIGNALS = 31
    COMMANDED = 32  # of the signals, those that act beside commands
    READ = 33  # those that are errors of outputs
    WAVES = 34  # terms of all
    AT_WEIGHTS = 35
    AT_CELLS = 36
    POWERS = 37  # coefficients of what enters as a function of time alone; 0 where all follows from the state
    SINCE = 38  # when that begins [s]
    UNIT = 39  # of its time [s]
    AT_COURSE = 40
    N_V = 41  # readings of the controller: the outputs, then signals that it is given
    VALUES = 42  # of Gaussian noises
    AT_VALUES = 43
    SHARES = 44  # of the signals, the last, whose size is a share of a command
    DIRECT = 45  # commands that follow from outputs without a state between them: n_u or 0
    AT_S = 46
    RATED = 47  # states whose rates have a part that is a function of time alone: N_a or 0
    AT_DRIFT = 48


HEADER = 49

PARTS: tuple[tuple[Slot, str, tuple[Slot | int, ...]], ...] = (
    (Slot.AT_M, "M", (Slot.SIZE, Slot.SIZE)),
    (Slot.AT_N, "N", (Slot.SIZE, Slot.N_V)),
    (Slot.AT_K, "K", (Slot.N_U, Slot.SIZE)),
    (Slot.AT_J, "J", (Slot.SIZE, Slot.SIZE)),
    (Slot.AT_G, "G", (Slot.SIZE, Slot.SIZE)),
    (Slot.AT_R, "R", (Slot.ROWS, Slot.SIZE)),
    (Slot.AT_CUTS, "cuts", (Slot.FACES,)),
    (Slot.AT_SEGMENTS, "segments", (Slot.SEGMENTS, 5)),
    (Slot.AT_SPAN_K, "span_K", (2,)),
    (Slot.AT_Y_0, "y_0", (Slot.N_Y,)),
    (Slot.AT_CTRL_0, "ctrl_0", (Slot.N_U,)),
    (Slot.AT_PUSHES, "pushes", (Slot.PUSHES, WIDTH)),
    (Slot.AT_TERMS, "terms", (Slot.TERMS, 6)),  # these three one after the other: signals count their terms throughout
    (Slot.AT_ERRORS, "errors", (Slot.ERRORS, 6)),
    (Slot.AT_SIZES, "sizes", (Slot.SIZES, 6)),
    (Slot.AT_SIGNALS, "signals", (Slot.SIGNALS, SIGNAL)),
    (Slot.AT_WEIGHTS, "weights", (Slot.WAVES, WEIGHTS)),
    (Slot.AT_CELLS, "cells", (Slot.SIGNALS, CELL)),
    (Slot.AT_COURSE, "course", (Slot.N_U, Slot.POWERS)),
    (Slot.AT_DRIFT, "drift", (Slot.RATED, Slot.POWERS)),
    (Slot.AT_VALUES, "values", (Slot.VALUES,)),
    (Slot.AT_S, "S", (Slot.DIRECT, Slot.N_Y)),
)
"""Slot with the beginning, name, and shape by slots of the header, of each part."""


@dataclass(frozen=True, eq=False)
class Block:
    """The controller in a model: writable views of the data of its numeric.

    Attributes:
        header: by :class:`Slot`, shape (49,).
        M, N: ȧ = M a + N (y + n(t) − y_0), shapes (N_a, N_a), (N_a, n_v); y − y_0 is zero beyond the n_y outputs.
        K, S: u = −K a − S (y + n(t) − y_0), the command; ctrl = ctrl_0 + u + d(t); shapes (n_u, N_a) and (n_u, n_y), or
            (0, n_y) where no output enters it directly.
        J, G: a := J a at an event, a := G a at its action; shapes (N_a, N_a).
        R, cuts: faces |R_j a| = 1 of the event rule; first row of each in ``cuts``; shapes (r, N_a) and (F,).
        segments: first row and end of each segment of the state, first column of M that is not zero there and end, and
            whether N is not zero there; shape (S, 5).
        span_K: first column of K that is not zero, and end; shape (2,).
        y_0, ctrl_0: outputs and controls at the operating point, shapes (n_y,), (n_u,).
        terms: disturbance d(t): input, amplitude, ω, φ, start, end (1e30 for ever); shape (M, 6).
        errors: errors n(t) of the outputs as the observer reads them, and signals that the controller is given: column
            of N, and as in ``terms``, where a term that ends when it starts is an impulse of that area; shape (M_n, 6).
        pushes: where something acts on the plant itself (:mod:`icmj.engine.linearisation`), shape (K, 11).
        sizes: how large it is there: row of ``pushes``, and as in ``terms``; shape (M_p, 6).
        signals, weights, cells: the same terms as :mod:`icmj.engine.signals` has them, shapes (S, 6), (M + M_n + M_p,
            28), (S, 201).
        values: of all Gaussian noises on their grids, shape (V,).
        course, drift: of a controller with delayed readings, what these make of its command and of its state's rates,
            as polynomials in (t − SINCE)/UNIT, which whoever runs it writes; shapes (n_u, POWERS) and (N_a, POWERS), or
            (0, POWERS) where the command is known ahead and the state stands outside the model.
    """

    header: Array
    M: Array
    N: Array
    K: Array
    J: Array
    G: Array
    R: Array
    cuts: Array
    segments: Array
    span_K: Array
    y_0: Array
    ctrl_0: Array
    terms: Array
    errors: Array
    pushes: Array
    sizes: Array
    signals: Array
    weights: Array
    cells: Array
    course: Array
    drift: Array
    values: Array
    S: Array

    @property
    def act(self) -> slice:
        """The place of the controller's states in ``act``."""
        start = int(self.header[Slot.ACT])
        return slice(start, start + int(self.header[Slot.SIZE]))

    @property
    def edges(self) -> np.ndarray:
        """First row of each face and the number of rows, as integers, shape (F + 1,)."""
        return np.append(self.cuts, len(self.R)).astype(np.int64)


def pack(
    realisation: Realisation,
    y_0: Array,
    ctrl_0: Array,
    disturbance: Disturbance,
    errors: Disturbance,
    pushes: Array,
    sizes: Disturbance,
    act: int,
    stage: int,
    powers: int = 0,
    rated: bool = False,
    drawn: Sequence[Sequence[tuple[int, float, Gridded]]] = ((), (), (), ()),
    duration: float = 0.0,
) -> Array:
    """The numeric's data.

    Args:
        realisation: the controller.
        y_0, ctrl_0: outputs and controls at the operating point.
        disturbance: beside the plant's commands.
        errors: of its outputs as the observer reads them.
        pushes: where something acts on the plant itself.
        sizes: how large it is there.
        act: where the controller's states begin in ``act``.
        stage: last sensor stage needed.
        powers: coefficients of what is a function of time alone.
        rated: whether that enters the rates of the controller's state, too; then the matrices may be any others of
            their shapes later on.
        drawn: Gaussian noises beside commands, of outputs, of how large pushes are, and those whose size is a share of
            a command: place, factor and noise.
        duration: of the run, for which they are drawn [s].
    """
    tables = [sort_terms(_table(terms)) for terms in (disturbance, errors, sizes)]
    signals = [list_signals(table, sum(map(len, tables[:i]))) for i, table in enumerate(tables)]
    signals.append(list_signals(tables[0][:0], 0))
    values = [np.zeros(0)]
    for i, noises in enumerate(drawn):
        rows, found = draw_signals(noises, sum(map(len, values)), duration)
        signals[i] = np.concatenate([signals[i], rows])
        values.append(found)
    flat, waves = np.concatenate(signals), np.concatenate(tables)
    parts = {
        **{name: getattr(realisation, name) for name in ("M", "N", "K", "J", "G", "R")},
        "cuts": realisation.cuts[:-1],
        "segments": _whole(realisation) if rated else _segments(realisation),
        "span_K": (0, realisation.layout.size) if rated else find_span(realisation.K),
        "y_0": y_0,
        "ctrl_0": ctrl_0,
        **dict(zip(("terms", "errors", "sizes"), tables, strict=True)),
        "pushes": pushes,
        "signals": flat,
        "weights": compute_weights(waves, flat).reshape(-1, WEIGHTS),
        "cells": make_cells(flat),
        "course": np.zeros((len(ctrl_0), powers)),
        "drift": np.zeros((realisation.layout.size if rated else 0, powers)),
        "S": realisation.modes[0].S[:, : len(y_0)] if rated else np.zeros((0, len(y_0))),
        "values": np.concatenate(values),
    }
    header = np.zeros(HEADER)
    header[[Slot.MAGIC, Slot.VERSION, Slot.PHASE, Slot.ACT, Slot.STAGE]] = MAGIC, VERSION, -1.0, act, stage
    header[[Slot.COMMANDED, Slot.READ, Slot.SHARES, Slot.UNIT]] = *(len(signals[i]) for i in (0, 1, 3)), 1.0
    at = HEADER
    for slot, name, shape in PARTS:
        header[slot] = at
        at += np.size(parts[name])
        for part, extent in zip(shape, np.shape(parts[name]), strict=True):
            if isinstance(part, Slot):
                header[part] = extent
    return np.concatenate([header, *(np.ravel(parts[name]) for _, name, _ in PARTS)])


def read_numbers(model: mujoco.MjModel) -> Array:
    """The data of the last numeric in ``model``, which in a composed one is the controller; a view."""
    start, size = int(model.numeric_adr[-1]), int(model.numeric_size[-1])
    return np.asarray(model.numeric_data[start : start + size])


def find_block(model: mujoco.MjModel) -> Block | None:
    """The controller in ``model``, or ``None`` where the model is not a composed one."""
    if model.nnumeric == 0:
        return None
    data = read_numbers(model)
    if len(data) < HEADER or data[Slot.MAGIC] != MAGIC or data[Slot.VERSION] != VERSION:
        return None
    parts = {}
    for slot, name, shape in PARTS:
        extents = [int(data[part]) if isinstance(part, Slot) else part for part in shape]
        at = int(data[slot])
        parts[name] = data[at : at + prod(extents)].reshape(extents)
    return Block(header=data[:HEADER], **parts)


def find_span(matrix: Array) -> tuple[int, int]:
    """First column that is not zero throughout, and the one after the last; (0, 0) for a zero matrix."""
    used = np.flatnonzero(matrix.any(axis=0))
    return (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 0)


def _table(terms: Disturbance) -> Array:
    return np.minimum(terms.table, (*[np.inf] * 5, FOREVER))


def _segments(realisation: Realisation) -> Array:
    rows = [realisation.layout[name] for name in realisation.layout.names]
    M, N = realisation.M, realisation.N
    return np.array([(r.start, r.stop, *find_span(M[r]), N[r].any()) for r in rows], dtype=float)


def _whole(realisation: Realisation) -> Array:
    """One segment over all states, whatever is zero."""
    size = realisation.layout.size
    return np.array([[0, size, 0, size, 1]], dtype=float)


def rows_need_forward(model: mujoco.MjModel) -> bool:
    """Whether sensors exist that the outputs' stages do not refresh, so that a recorded row takes a whole pass."""
    block = find_block(model)
    assert block is not None
    return bool(model.nsensor and model.sensor_needstage.max() > block.header[Slot.STAGE])
