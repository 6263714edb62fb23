"""One open-loop interval on the linear plant, exactly, as a function of the state at its event."""

from __future__ import annotations

import numpy as np

from icmj.base.array import Array
from icmj.controller.controller import Controller, start_state
from icmj.linear.simulator import Simulator
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation import ending
from icmj.simulation.native.loop import Status
from icmj.simulation.open_loop import OpenLoopInterval, expect_one_in_flight
from icmj.simulation.settings import Settings


class LinearOpenLoop:
    """Simulates from event to event; see :class:`icmj.simulation.open_loop.OpenLoop`. Not for two threads at once."""

    def __init__(self, simulator: Simulator) -> None:
        expect_one_in_flight(simulator.loop.controller)
        self._simulator = simulator

    def __call__(self, x: Array, x_o: Array, x_h: Array | None = None, t: float = 0.0) -> OpenLoopInterval:
        """One interval from an event at ``t``; it ends at the settings' duration if no event comes."""
        simulator, loop = self._simulator, self._simulator.loop
        x, x_o = np.asarray(x, float), np.asarray(x_o, float)
        x_h = x_o if x_h is None else np.asarray(x_h, float)
        simulator.begin(loop.state(x, start_state(loop.controller, x_o, x_h)), t)
        while (status := simulator.advance(1)[0]) is Status.RUNNING:
            pass
        if status is Status.REACHED:
            end, z, y_max, y_min = simulator.last_event()
            outcome = None
        else:
            end, z = simulator.t, simulator.z.copy()
            y_max, y_min = np.full(loop.plant.n_y, np.nan), np.full(loop.plant.n_y, np.nan)
            complete = status is Status.COMPLETED
            outcome = ending.end_complete(end, np.zeros(0), 0.0) if complete else simulator.end.tell(status, end, z)
        x = loop.x(z)
        return OpenLoopInterval(end - t, x, loop.x_o(z), loop.x_h(z), loop.plant.C @ x, y_max, y_min, outcome)


def open_loop(plant: LinearPlant, controller: Controller, settings: Settings) -> LinearOpenLoop:
    """The open-loop interval of ``plant`` under ``controller``; ``settings`` give duration, limit and disturbance.

    Raises:
        SimulationError: if plant and controller do not fit, or a disturbance names an unknown input or output.
    """
    return LinearOpenLoop(Simulator(plant, controller, settings))
