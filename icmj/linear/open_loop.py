"""One open-loop interval on the linear plant, exactly, as a function."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller
from icmj.linear.flight import Stage, stage
from icmj.linear.native.state import Status
from icmj.linear.passage import Passage, suits
from icmj.linear.queue import Queue
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation import ending
from icmj.simulation.interval import OpenLoopInterval, one_in_flight
from icmj.simulation.settings import Settings


class LinearOpenLoop:
    """Flies from event to event; see :class:`icmj.simulation.interval.OpenLoop`. Not for two threads at once."""

    def __init__(self, stage: Stage, native: bool = True) -> None:
        one_in_flight(stage.loop.controller)
        self.stage = stage
        self._passage = Passage(stage) if native and suits(stage) else None

    def __call__(self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0) -> OpenLoopInterval:
        """One interval from an event at ``t``; it ends at the settings' duration if no event comes."""
        loop, end = self.stage.loop, t
        x, x_o = np.asarray(x, float), np.asarray(x_o, float)
        x_h = x_o if x_h is None else np.asarray(x_h, float)
        z = loop.state(x, x_o, x_h)
        if self._passage is not None and t < self.stage.duration:
            return self._compiled(self._passage, z, t)
        queue = Queue(loop.controller)
        if loop.controller.delay:
            queue.take_up(t, x_o, x_h)
        y_max, y_min, piece = np.full(loop.plant.n_y, -np.inf), np.full(loop.plant.n_y, np.inf), None
        for _, piece, end in self.stage.flight(z, t, queue):  # noqa: B007
            y_max, y_min = np.maximum(y_max, piece.y_max), np.minimum(y_min, piece.y_min)
        outcome = None
        if piece is None or piece.kind == "end":
            outcome = ending.ran(self.stage.duration, np.zeros(0), 0.0)
        elif piece.kind != "event":
            outcome = self.stage.outcome(piece.kind, piece.z, end)
        if outcome is not None:
            y_max, y_min = (np.full_like(y_max, np.nan) for _ in range(2))
        z = z if piece is None else piece.z[: len(z)]
        x = loop.x(z)
        return OpenLoopInterval(end - t, x, loop.x_o(z), loop.x_h(z), loop.plant.C @ x, y_max, y_min, outcome)

    def _compiled(self, passage: Passage, z: Array, t: float) -> OpenLoopInterval:
        loop = self.stage.loop
        passage.begin(z, t)
        while (status := passage.advance(1)[0]) is Status.MORE:
            pass
        if status is Status.REACHED:
            end, z, y_max, y_min = passage.last_event()
            outcome = None
        else:
            end, z = passage.t, passage.z.copy()
            y_max, y_min = np.full(loop.plant.n_y, np.nan), np.full(loop.plant.n_y, np.nan)
            outcome = ending.ran(end, np.zeros(0), 0.0) if status is Status.ENDED else passage.outcome(status)
        x = loop.x(z)
        return OpenLoopInterval(end - t, x, loop.x_o(z), loop.x_h(z), loop.plant.C @ x, y_max, y_min, outcome)


def open_loop(plant: LinearPlant, controller: Controller, settings: Settings) -> LinearOpenLoop:
    """The open-loop interval of ``plant`` under ``controller``; ``settings`` give duration, limit and disturbance.

    Raises:
        SimulationError: if plant and controller do not fit, or a disturbance names an unknown input or output.
    """
    return LinearOpenLoop(stage(plant, controller, settings), settings.native)
