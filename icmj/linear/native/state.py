"""What the compiled simulation works on: one array of numbers that stay, one of numbers that change, and buffers."""

from __future__ import annotations

from enum import IntEnum, auto
from typing import NamedTuple

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


class Size(IntEnum):
    """Entries of the array of sizes."""

    STATES = 0
    """m of z."""
    PLANT = auto()
    """n of x, the first of z."""
    MODEL = auto()
    """n̂ of d and of e, which follow."""
    FACE_ROWS = auto()
    FACES = auto()
    POSITIONS = auto()
    OUTPUTS = auto()
    DEGREE = auto()
    """N of the series of a step."""
    COARSE = auto()
    """Degree of the polynomials that bound a span."""
    STEPS = auto()
    """Steps of a span."""
    DELAYED = auto()


class Fact(IntEnum):
    """The first entries of the array of numbers that stay; the matrices follow."""

    STEP = 0
    """h [s]."""
    END = auto()
    """[s]."""
    INTERVAL = auto()
    """Between two recorded rows [s]; infinite if none are asked for."""
    CLOCK = auto()
    """[s]; infinite if there is none."""
    LEAST = auto()
    """The least time between two events of a rule [s]."""
    DELAY = auto()
    """t_d [s]."""


class Now(IntEnum):
    """The first entries of the array of numbers that change; vectors follow."""

    TIME = 0
    READY = auto()
    """When the event function is watched from [s]."""
    TICK = auto()
    """When the clock ticks next [s]."""
    ACTION = auto()
    """When the prediction that is under way acts [s]; infinite if none is."""
    ROW = auto()
    """When the last row was [s]."""


class Count(IntEnum):
    """Entries of the array of counts."""

    ROWS = 0
    """Written into the buffer."""
    EVENTS = auto()
    """Written into the buffer."""
    NEXT = auto()
    """Number of the next row of the grid."""
    AGE = auto()
    """Rows since the state of one was last taken from the steps'."""


class Flow(NamedTuple):
    """The matrices, which act on z from the left.

    Attributes:
        P, G: z one step on, and h ż; shape (m, m).
        Q: z one row on, shape (m, m).
        W: z one span on, then Bernstein coefficients of short polynomials for faces and outputs over the
            span, then the positions.
        V: bounds, from the sizes of z's entries, of what these leave out: of the values of faces, the slopes of
            outputs; and of how far positions move.
        A: power coefficients of faces, positions and outputs over a step, shape (rows, N + 1, m).
        F, F2: from power to Bernstein coefficients of degree N and 2N.
        O, X: x_o, and the prediction made of it and x_h; shape (n̂, m).
    """

    P: Array
    G: Array
    Q: Array
    W: Array
    V: Array
    A: Array
    F: Array
    F2: Array
    O: Array
    X: Array


class Work(NamedTuple):
    """Scratch: curves of rows, the level of a face, pending intervals of a search and their coefficients."""

    curves: Array
    level: Array
    stack: Array
    spans: Array


FACTS, NOW, COUNTS = len(Fact), len(Now), len(Count)
FRESH = 1 << 30  # an age that makes the next row be taken from the steps
