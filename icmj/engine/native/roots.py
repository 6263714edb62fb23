"""The first root of the event function, which is a polynomial on each adaptive step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from icmj.base.array import Array
from icmj.base.bernstein import from_powers
from icmj.base.roots import DEEPEST, evaluate, first_root
from icmj.engine.native.compilation import compiled
from icmj.engine.tableau import POWER

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
