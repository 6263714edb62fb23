"""Outcomes of a run: the same rules and words for both simulators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from icmj.base.array import Array

OutcomeKind = Literal["completed", "fell", "diverged", "interrupted", "sliding", "stalled"]

WINDOW = 5000  # events over which their pace is taken
MOST_EVENTS = 1e7  # more than these in a run, at the pace of the last window, and it gets nowhere
SLIDING = 20  # successive intervals at Δ_min at the end of a run that are called sliding


@dataclass(frozen=True)
class Outcome:
    """How a simulation ended.

    Attributes:
        kind: ``completed``; ``fell`` (a position passed the limit in the settings); ``diverged`` (not finite, or
            an engine warning); ``interrupted``; ``sliding`` (every interval collapsed to Δ_min);
            ``stalled`` (events come so fast that time does not go on).
        t: when [s].
        message: what the run did, to be read after "The run": ``ran to 40 s``.
    """

    kind: OutcomeKind
    t: float
    message: str


def end_fallen(t: float, state: str, limit: float, unit: str = "") -> Outcome:
    """A position departed further than its limit."""
    return Outcome(
        "fell", t, f"fell at {t:.6g} s: {state} departed further than its limit of {limit:g} {unit}".rstrip()
    )


def end_diverged(t: float, why: str) -> Outcome:
    """The outcome of a run whose numbers are not finite, or in which the engine failed."""
    return Outcome("diverged", t, f"diverged at {t:.6g} s: {why}")


def end_interrupted(t: float, duration: float) -> Outcome:
    """The outcome of a run that the user interrupted."""
    return Outcome("interrupted", t, f"was interrupted at {t:.6g} s of {duration:g} s")


def end_stalled(t: float, took: float | None = None) -> Outcome:
    """The outcome of a run in which too many events occur in too little time, ``took`` [s]; or too many switches."""
    if took is None:
        return Outcome(
            "stalled",
            t,
            f"stalled at {t:.6g} s: the modes of the controller switch to and fro without an end; make the next switch "
            "depend on more than the guard that has just changed, or on a delay",
        )
    return Outcome(
        "stalled",
        t,
        f"stalled at {t:.6g} s: {WINDOW} events in the last {took:.2g} s; give it a delta_min, or a higher threshold",
    )


class EventPace:
    """Detects events so frequent that a run makes no progress, because the hold error passes its threshold at once."""

    def __init__(self, duration: float) -> None:
        self._least = duration / MOST_EVENTS * WINDOW
        self._times: list[float] = []

    def stalled(self, *times: float) -> float | None:
        """Add the times of events [s]; how long the last window took [s] if that is too little, else ``None``."""
        self._times += times
        if len(self._times) < WINDOW:
            return None
        took = self._times[-1] - self._times[-WINDOW]
        self._times = self._times[1 - WINDOW :]
        return took if took < self._least else None


def end_complete(duration: float, intervals: Array, delta_min: float) -> Outcome:
    """The outcome of a run that reached its end: completed, or sliding if its last :data:`SLIDING` intervals are Δ_min.

    Args:
        duration: [s].
        intervals: open-loop intervals of the whole run [s], shape (K,).
        delta_min: the least interval, Δ_min or a longer delay [s]; 0 if there is none.
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
