"""From one event to the next, piece by piece: what the simulation repeats and the open-loop interval is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.linear.closed_loop import LinearLoop, Stretch, closed_loop, stretches
from icmj.linear.queue import Queue
from icmj.linear.watch import DIVERGED, Piece, Watch
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation import ending
from icmj.simulation.disturbance import Disturbance, disturbance_of, reading_error_of
from icmj.simulation.ending import Outcome
from icmj.simulation.settings import Settings

_TINY = 1e-290  # a state below this is zero for every purpose; subnormal numbers would only be slow


@dataclass(frozen=True, eq=False)
class Stage:
    """A closed loop prepared for flights: its propagators and bounds, one for each stretch of the disturbance."""

    loop: LinearLoop
    disturbance: Disturbance
    stretches: tuple[tuple[Stretch, Watch], ...]
    duration: float
    limit: float

    def flight(self, z: Array, t: float, queue: Queue) -> Iterator[tuple[Watch, Piece, float]]:
        """Pieces of the motion from ``z`` right after an event at ``t``, each with its watch and when it ends [s].

        The last one ends in an event (also one that falls due by the clock), a fall, divergence, or at the end of
        the duration. An event falls on the first time after Δ_min and the delay at which E ≥ 0, on that time itself if
        E ≥ 0 there. Actions of the ``queue`` end pieces on the way; those hold the state after the action.
        """
        trigger, faces, size = self.loop.controller.trigger, self.loop.faces, len(z)
        ready = t + self.loop.controller.least
        clock = (
            (np.floor(t / trigger.clock * (1 + 1e-12)) + 1) * trigger.clock if np.isfinite(trigger.clock) else np.inf
        )
        for stretch, watch in self.stretches:
            while t < stretch.end:
                armed = len(faces) > 0 and t >= ready
                act = queue.due
                due = min(clock, act, np.inf if armed or not len(faces) else ready)
                if np.abs(z).max() < _TINY:
                    z = np.zeros_like(z)
                stop = min(due, stretch.end)
                piece = watch.advance(stretch.augmented(z, t), stop - t, armed)
                # landing on a time set in advance is exact; adding the piece's length would round
                t = stop if piece.complete and piece.kind == "end" else t + piece.length
                if piece.kind == "end" and t == act:
                    piece = piece.ended(self.loop.reset(piece.z[:size], queue.act()))
                z = piece.z[:size]
                if piece.kind == "end" and t == clock:
                    piece = piece.as_event()
                yield watch, piece, t
                if piece.kind != "end":
                    return

    def outcome(self, kind: str, z: Array, t: float) -> Outcome:
        """What it means that a flight ended at ``t`` in ``z`` because it ``fell`` or ``diverged``."""
        if kind == "fell":
            positions = self.loop.positions
            state = positions[np.argmax(np.abs(z[positions]))]
            return ending.fell(t, self.loop.plant.states[state], self.limit)
        return ending.diverged(t, f"a state exceeded {DIVERGED:g}")


def stage(plant: LinearPlant, controller: Controller, settings: Settings) -> Stage:
    """Prepare the closed loop of ``plant`` under ``controller`` with the duration, limit and disturbance of a run.

    Raises:
        SimulationError: if plant and controller do not fit, or a disturbance names an unknown input or output.
    """
    loop = closed_loop(plant, controller)
    duration = float(settings.duration)
    sources = settings.disturbance
    disturbance, errors = disturbance_of(sources, plant.inputs), reading_error_of(sources, plant.outputs)
    parts = stretches(loop, disturbance, errors, duration)
    watched = tuple((part, Watch(loop, part.propagator, settings.limit)) for part in parts)
    return Stage(loop, disturbance, watched, duration, settings.limit)
