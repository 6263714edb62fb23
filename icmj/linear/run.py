"""The exact simulation of the intermittently controlled linear plant: events root-found, nothing integrated by steps.

Between events the state follows a matrix exponential. A step of the internal grid only fixes where its series is
expanded; on each step the event function is a polynomial (to round-off), and whether it reaches zero anywhere on the
step is decided by its Bernstein coefficients, not by sampling. The same holds for the limit on positions and for the
extremes of the outputs. What disturbs, noise included, is a function of time whose response is exact, too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.environment import single_threaded
from icmj.controller.controller import has_trigger
from icmj.controller.law import Law
from icmj.linear.simulator import Simulator
from icmj.linear.tapped import simulate_tapped
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.labels import labels_of
from icmj.simulation.recording import driven, kept
from icmj.simulation.settings import Settings, start_states
from icmj.simulation.simulation import Events, Simulation
from icmj.simulation.taps import expect_no_observer


@single_threaded()
def simulate(
    plant: LinearPlant,
    controller: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate ``plant`` under ``controller`` from a departure from the operating point.

    Args:
        plant: the actual plant; its order may differ from that of the controller's model.
        controller: design, hold and trigger (event, clock or continuous), or one that reads delayed outputs only
            (:func:`icmj.linear.tapped.simulate_tapped`).
        settings: duration, start, recording, limit and disturbances; ``timestep`` and ``integrator`` are for MuJoCo.
        x0, x_o0: start of plant (n,) and observer (n̂,), instead of the named states in ``settings``.
        x_h0: start of the hold state (n̂,); the observer's by default, because t = 0 is an event.
        progress: called repeatedly with the completed fraction, 0–1.

    Returns:
        Recorded at multiples of ``record_interval``, at every event (values just before the reset) and at the end.
        Events are exact to 1e-12 s.

    Raises:
        SimulationError: if plant and controller do not fit, a start state is unknown, of the wrong shape or not
            finite, or a disturbance names an unknown input or output.
    """
    if not has_trigger(controller):
        expect_no_observer(controller, settings, x_o0, x_h0)
        return simulate_tapped(plant, controller, settings, x0=x0, progress=progress)
    x, a = start_states(plant, controller, settings, x0, x_o0, x_h0)
    simulator = Simulator(plant, controller, settings, settings.record_interval)
    loop = simulator.loop
    found, outcome = simulator.run(loop.state(x, a), progress)
    x, rows, at_events = (
        loop.x(found.Z),
        *(kept(controller, loop.x_o(Z), loop.x_h(Z), loop.e(Z)) for Z in (found.Z, found.event_Z)),
    )
    beside = simulator.disturbance
    return Simulation(
        plant="linear",
        control=controller.trigger.kind,
        t=found.t,
        x=x,
        y=x @ plant.C.T,
        u=rows.u,
        x_o=rows.x_o,
        x_h=rows.x_h,
        E=rows.E,
        events=Events(
            t=found.event_t,
            x=loop.x(found.event_Z),
            x_o=at_events.x_o,
            x_h=at_events.x_h,
            y_max=found.y_max,
            y_min=found.y_min,
        ),
        applied=rows.u + beside.beside(found.t, rows.u) if len(beside) else np.zeros((0, 0)),
        outcome=outcome,
        precision={
            "integrator": "matrix exponential",
            "order": "exact",
            "event_tolerance": 1e-12,
            "step": simulator.tables.step,
            "series_terms": simulator.tables.A.shape[1],
        },
        delay=controller.delay.t_d,
        least=controller.least,
        noisy=settings.noisy,
        labels=labels_of(plant, controller.design.plant),
        **driven(controller, simulator.pushes, found.t),
    )
