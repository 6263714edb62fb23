"""What the compiled simulation works on: numbers that stay, numbers that change, and buffers.

The state that it moves is s = (z, f): z the moving part of the closed loop's state w
(:mod:`icmj.controller.closed_loop`), and f the Taylor coefficients of what acts on it from outside, in steps, signal by
signal within each power. A polynomial that acts on a linear system is part of a larger linear system that nothing acts
on, so one matrix of s does for quiet and disturbed motion alike; quiet motion has no f.
"""

from __future__ import annotations

from enum import IntEnum, auto
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array


class Status(IntEnum):
    """Why the compiled simulation came back."""

    MORE = 0
    """A buffer is full, or it has worked for a while: call again."""
    ENDED = auto()
    FELL = auto()
    DIVERGED = auto()
    REACHED = auto()
    """The number of events asked for."""


class Tables(NamedTuple):
    """What stays: m of z, l of s, S signals, K sinusoids, p the degree of f.

    Attributes:
        step: h [s].
        end: of the run [s].
        interval: between two recorded rows [s]; infinite if none are asked for.
        clock: its interval [s]; infinite if there is none.
        least: the least time between two events of a rule [s].
        delay: t_d [s].
        ticks: the delay in intervals of the clock where it is a multiple of that, else −1.
        steps: q, of a span.
        coarse: degree of the polynomials that bound a span.
        P: z one step on, from s at its start; shape (m, l).
        M: h M, shape (m, m).
        D: h times what each signal does to ż, shape (m, S).
        Q: z one row on, of quiet motion; shape (m, m).
        W: from s at a span's start, with f about its middle: z one span on, then Bernstein coefficients of short
            polynomials for faces and outputs over the span, then the positions; shape (…, l).
        V: bounds, from the sizes of s's entries, of what these leave out: of the values of faces, the slopes of
            outputs; and of how far positions move; shape (…, l).
        A: power coefficients of faces, positions and outputs over a step, shape (rows, N + 1, l).
        F, F2: from power to Bernstein coefficients of degree N and 2N.
        J, G: what an event and its action do to w.
        cuts: first row of each face of the event rule, and the number of rows.
        edges: when terms begin or end to act, rising, the last infinite [s].
        ranges: the sinusoids of signal i are those from ranges[i] to ranges[i + 1]; shape (S + 1,).
        omega, phase, first, last: of each sinusoid: ω [rad/s], φ [rad], window [s]; shape (K,).
        share: ± a (ωh)^j/j! of each sinusoid, of its cosine for even j and its sine for odd; shape (p + 1, K).
        turn: cos and sin of a span's ω q h, shape (2, K).
    """

    step: float
    end: float
    interval: float
    clock: float
    least: float
    delay: float
    ticks: int
    steps: int
    coarse: int
    P: Array
    M: Array
    D: Array
    Q: Array
    W: Array
    V: Array
    A: Array
    F: Array
    F2: Array
    J: Array
    G: Array
    cuts: np.ndarray
    edges: Array
    ranges: np.ndarray
    omega: Array
    phase: Array
    first: Array
    last: Array
    share: Array
    turn: Array


class Run(NamedTuple):
    """What changes, and room to work in.

    Attributes:
        now, counts: by :class:`Now` and :class:`Count`.
        w: the loop's state; its first entries are z.
        s: (z, f) where a span or a step begins, f about the middle of the one and the beginning of the other.
        wave: cos and sin of each sinusoid's angle in the middle of the span, zero where it does not act; (2, K).
        row: z of the last row of quiet motion.
        high, low: largest and smallest outputs since the last event.
        rows_t, rows_z, events: buffers; an event is its time, w just before, ``high`` and ``low``.
    """

    now: Array
    counts: np.ndarray
    w: Array
    s: Array
    wave: Array
    row: Array
    high: Array
    low: Array
    rows_t: Array
    rows_z: Array
    events: Array


class Now(IntEnum):
    """Times [s]."""

    TIME = 0
    READY = auto()
    """When the event function is watched from."""
    TICK = auto()
    """When the clock ticks next."""
    ACTION = auto()
    """When the oldest prediction under way acts; infinite if none is."""
    EDGE = auto()
    """When a term begins or ends to act next."""
    ROW = auto()
    """When the last row was."""
    BEGIN = auto()
    """Of the piece under way."""
    STOP = auto()
    """Of the piece under way."""


class Count(IntEnum):
    """Counts and marks."""

    ROWS = 0
    """Written into the buffer."""
    EVENTS = auto()
    """Written into the buffer."""
    NEXT = auto()
    """Number of the next row of the grid."""
    AGE = auto()
    """Rows since the state of one was last taken from the steps'."""
    TICK = auto()
    """Number of the clock's next event."""
    ACTED = auto()
    """Number of the clock's event that acts next."""
    STEP = auto()
    """Steps done of the piece under way; −1 where none is."""
    ARMED = auto()
    """Whether the event function is watched in it."""


class Work(NamedTuple):
    """Scratch: curves of rows, the level of a face, pending intervals of a search and their coefficients."""

    curves: Array
    level: Array
    stack: Array
    spans: Array


FRESH = 1 << 30  # an age that makes the next row be taken from the steps
