"""The classification of a motion from its events, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from icmj.base.array import Array
from icmj.base.card import Card, Shown
from icmj.base.numbers import amount, amounts

MotionKind = Literal[
    "cycle", "quasi-periodic", "irregular", "growth", "decay", "homoclinic", "noisy", "too short", "no events"
]


@dataclass(frozen=True, eq=False, repr=False)
class Measurement(Shown):
    """The motion at the end of a run, read from its events.

    Attributes:
        kind: kind of the motion. ``homoclinic``: the interval keeps growing while the state decays; ``noisy``: noise
            drives the motion, which is then described by its :mod:`icmj.measurement.statistics`.
        p: events per period (1, 2, ... 8), or ``None`` without a cycle. A mirrored cycle has an even p.
        mirrored: whether the second half of the cycle is the first with opposite sign.
        asymmetry: largest relative departure of the second half of a cycle of an even number of events from the mirror
            image of the first, of x̄ and of the intervals; NaN with an odd number or without a cycle.
        interval: mean open-loop interval over the last period [s] or, without a cycle, over the last intervals or,
            under noise, over the run; ``None`` without events.
        intervals: the intervals of the last period [s], shape (p,); empty without a cycle.
        period: time after which the state repeats [s], or ``None``.
        amplitude: peak magnitude of every output over the last period or, without a cycle, over the last ten events;
            shape (n_y,).
        residual: largest relative closure error of the last period, of x̄ and of the intervals after p events (on
            a mirrored cycle after p/2 events, up to the sign); NaN without a cycle.
        words: the motion in one sentence.
        outputs, output_units: names and units of the outputs; empty if unknown.
    """

    kind: MotionKind
    p: int | None
    mirrored: bool
    interval: float | None
    intervals: Array
    period: float | None
    amplitude: Array
    residual: float
    words: str
    asymmetry: float = float("nan")
    outputs: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        name: str = self.kind
        if self.p is not None:
            name = f"{'mirrored ' if self.mirrored else ''}period-{self.p} cycle"
        interval = "" if self.interval is None else f", open-loop interval {amount(self.interval, 's')}"
        rows = (
            ("motion", name),
            ("period", amount(self.period, "s")),
            ("open-loop interval", amount(self.interval, "s")),
            ("peak of the outputs", amounts(self.amplitude, self.outputs, self.output_units)),
            ("closes to", amount(self.residual, figures=2)),
        )
        return Card(name + interval, rows, self.words)
