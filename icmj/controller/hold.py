"""The hold: what drives the control between events (paper, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.controller.design import Design


@dataclass(frozen=True, eq=False)
class Hold:
    """What the hold state does between events: ẋ_h = A_h x_h (eq. hold).

    Attributes:
        name: for people.
        A_h: hold matrix, shape (n̂, n̂).
    """

    name: str
    A_h: Array


def system_matched(design: Design) -> Hold:
    """The system-matched hold, A_h = Â_c = Â − B̂k̂ (eq. holde)."""
    return Hold("system-matched", design.A_c)


def zero_order(design: Design) -> Hold:
    """The zero-order hold, A_h = 0: the control stays what it was at the event."""
    return Hold("zero-order", np.zeros_like(design.A_c))


HOLDS = {"system-matched": system_matched, "zero-order": zero_order}
