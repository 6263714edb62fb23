"""What the compiled simulation works on: numbers that stay, numbers that change, and buffers.

The state that it moves is s = (z, f): z the moving part of the closed loop's state w
(:mod:`icmj.controller.controller`), and f the derivatives of what acts on it from outside, in steps, signal by
signal within each power. A polynomial that acts on a linear system is part of a larger linear system that nothing acts
on, so one matrix of s does for quiet and disturbed motion alike; quiet motion has no f.
"""

from __future__ import annotations

from enum import IntEnum, auto
from typing import NamedTuple

import numpy as np

from icmj.base.array import Array


class Tables(NamedTuple):
    """What stays: m of z, l of s, S signals, p powers of f.

    Attributes:
        step: h [s].
        end: of the run [s].
        interval: between two recorded rows [s]; infinite if none are asked for.
        clock: its interval [s]; infinite if there is none.
        wait: from an event until the rule is watched again [s].
        sampling: from where the rule reaches its threshold to the event [s].
        delay: t_d [s].
        coarse: degree of the polynomials that bound a step.
        controls: how many control points they have.
        places, stride: of disturbed motion, how many instants of a step are a row's in one step or another, and how
            many of these from row to row; no places if the grid of rows does not fit that of the steps.
        powers: p.
        M: h ż from z and the signals, shape (m, m + S).
        C: the outputs, shape (n_y, m).
        Q: quiet motion, z a row on, shape (1, m, m); disturbed motion, z at each of the places, from that at the step's
            start, shape (places, m, m).
        R: what f adds at each of the places, shape (places, m, l − m).
        W: from s at a step's start, with f about its middle: z a step on, then the positions, then Bernstein
            coefficients of short polynomials for outputs and faces over the step; shape (…, l).
        W_z: what W makes of z, by columns, shape (m, …).
        V: bounds, from the sizes of s's entries, of how far positions move; and of what these polynomials leave out,
            of the slopes of outputs and the values of faces; shape (…, l).
        A: power coefficients of faces, positions and outputs over a step, shape (rows, N + 1, l).
        F, F2: from power to Bernstein coefficients of degree N and 2N.
        terms: how many terms of the series of z there are to be until an eighth of a step, two eighths, … a whole one.
        ahead, back: of disturbed motion, z at each eighth of a step, from s at its start with f about its middle; and z
            at its start, from z at each eighth and the same f; shapes (9, m, l).
        near: how many terms of the series of z there are to be until half an eighth.
        J, G: what an event and its action do to w.
        cuts: first row of each face of the event rule, and the number of rows.
        edges: when terms begin or end to act, rising, the last infinite [s].
        jumps: what impulses do to z at each of these, shape (…, m); (0, 0) without any.
        H: x_h from z, where S noises are shares of commands (:mod:`icmj.linear.loop`), shape (n̂, m).
        points: where the second and each further stretch of these begins, rising, the last infinite [s]; (0,) without.
        begins: where each stretch begins [s].
        lines: value and slope of each noise where a stretch begins, shape (stretches, S, 2); (0, 0, 2) without.
    """

    step: float
    end: float
    interval: float
    clock: float
    wait: float
    sampling: float
    delay: float
    coarse: int
    controls: int
    places: int
    stride: int
    powers: int
    M: Array
    C: Array
    Q: Array
    R: Array
    W: Array
    W_z: Array
    V: Array
    A: Array
    F: Array
    F2: Array
    terms: np.ndarray
    ahead: Array
    back: Array
    near: int
    J: Array
    G: Array
    cuts: np.ndarray
    edges: Array
    jumps: Array
    H: Array
    points: Array
    begins: Array
    lines: Array


class Acting(NamedTuple):
    """What acts on K steps of the grid, one after the other, as long as the same terms do.

    Attributes:
        first: number of the first of these steps.
        edge: when terms begin or end to act next [s].
        f: derivatives at the middle of each step, in steps, shape (lanes, l − m, K / lanes): every so manieth step is
            in the same lane.
        moved: what they add to z a step on, shape (lanes, K / lanes, m).
        rows: what they add to z at each of the places but the first, shape (lanes, K / lanes, …).
        controls: what they add to the control points in W s, shape (lanes, K / lanes, …).
        tails: a bound of what they add to V |s| on any step.
    """

    first: int
    edge: float
    f: Array
    moved: Array
    rows: Array
    controls: Array
    tails: Array


class Run(NamedTuple):
    """What changes, and room to work in.

    Attributes:
        now, counts: by :class:`Now` and :class:`Count`.
        when, due, queue: what the controller has planned, see :mod:`icmj.simulation.native.loop`.
        w: the loop's state; its first entries are z.
        s: (z, f) where a step begins, or a part of one, and f about the place half a step further on.
        begun, ended: z where the step begins that the last piece ended in, and where it ended.
        row: z of the last row of quiet motion.
        high, low: largest and smallest outputs since the last event.
        rows_t, rows_z, events: buffers; an event is its time, w just before, ``high`` and ``low``.
    """

    now: Array
    counts: np.ndarray
    when: Array
    due: np.ndarray
    queue: Array
    w: Array
    s: Array
    begun: Array
    ended: Array
    row: Array
    high: Array
    low: Array
    rows_t: Array
    rows_z: Array
    events: Array


class Now(IntEnum):
    """Times [s]."""

    TIME = 0
    ROW = auto()
    """When the last row was."""
    ORIGIN = auto()
    """From when on steps are counted in the piece under way."""
    BEGIN = auto()
    """When the piece under way begins."""
    STOP = auto()
    """When it ends."""
    OFFSET = auto()
    """Where the piece under way is in its step, in steps."""


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
    CELL = auto()
    """Number of the step that the piece under way is in; −1 where none is under way."""
    ENDED = auto()
    """Number of the step that the last piece ended in; −1 where that tells nothing of the next."""
    STRETCH = auto()
    """Number of the stretch of the noises that are shares of commands."""
    MET = auto()
    """What ended the last piece."""
    LEFT = auto()
    """Steps until the caller is asked."""


class Work(NamedTuple):
    """Scratch: curves of rows, the level of a face, pending intervals of a search and their coefficients."""

    curves: Array
    level: Array
    stack: Array
    spans: Array


FRESH = 1 << 30  # an age that makes the next row be taken from the steps
