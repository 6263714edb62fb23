"""How a run ends, in one set of words and by one set of rules for both simulators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from icmj.base.array import Array

OutcomeKind = Literal["completed", "fell", "diverged", "interrupted", "sliding"]

SLIDING = 20  # successive intervals at Δ_min at the end of a run that are called sliding


@dataclass(frozen=True)
class Outcome:
    """How a simulation ended.

    Attributes:
        kind: ``completed``; ``fell`` (a position passed the limit in the settings); ``diverged`` (not finite, or
            an engine warning); ``interrupted``; ``sliding`` (every interval collapsed to Δ_min).
        t: when [s].
        message: what the run did, to be read after "The run": ``ran to 40 s``.
    """

    kind: OutcomeKind
    t: float
    message: str


def fell(t: float, state: str, limit: float) -> Outcome:
    """A position departed further than the limit."""
    return Outcome("fell", t, f"fell at {t:.6g} s: {state} departed further than its limit of {limit:g}")


def diverged(t: float, why: str) -> Outcome:
    """Numbers, or the engine, gave up."""
    return Outcome("diverged", t, f"diverged at {t:.6g} s: {why}")


def interrupted(t: float, duration: float) -> Outcome:
    """The user stopped it."""
    return Outcome("interrupted", t, f"was interrupted at {t:.6g} s of {duration:g} s")


def ran(duration: float, intervals: Array, delta_min: float) -> Outcome:
    """It ran to its end: completed, or sliding if the last :data:`SLIDING` intervals all collapsed to Δ_min.

    Args:
        duration: [s].
        intervals: open-loop intervals of the whole run [s], shape (K,).
        delta_min: Δ_min [s]; 0 if there is none.
    """
    longer = np.flatnonzero(intervals > delta_min * (1 + 1e-9) + 1e-12)
    collapsed = len(intervals) - (int(longer[-1]) + 1 if len(longer) else 0)
    if delta_min > 0 and collapsed >= SLIDING:
        return Outcome(
            "sliding",
            duration,
            f"slid: the last {collapsed} intervals all collapsed to the least one, {delta_min:g} s: "
            "the event rule no longer decides when to act",
        )
    return Outcome("completed", duration, f"ran to {duration:g} s")
