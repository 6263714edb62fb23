"""Plants and closed loops as input-output systems of python-control, to connect, simulate and analyse them there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from icmj.controller.controller import Controller
from icmj.engine.plant import MujocoPlant
from icmj.errors import AnalysisError, expect
from icmj.plant.linear_plant import LinearPlant, Match, expect_linear, match_ports
from icmj.plant.quality import MatrixPlant

if TYPE_CHECKING:
    from control import NonlinearIOSystem, StateSpace


AnyPlant = MujocoPlant | MatrixPlant
"""A plant of a case: a model on the engine, or matrices; either has its ``linearisation.plant`` and ``quality``."""


def to_iosystem(
    plant: LinearPlant | AnyPlant,
    controller: Controller | None = None,
    *,
    dt: float | None = None,
    match: Match = "name",
) -> StateSpace | NonlinearIOSystem:
    """A plant or its closed loop as a system of python-control; all quantities are deviations from the operating point.

    =============================  ==================================================================================
    plant alone                    ``StateSpace`` for a linear plant, ``NonlinearIOSystem`` for a MuJoCo model
    ``Continuous()``               the same for the loop; states (x, x_o)
    ``ClockTrigger(Δ)``            linear plant: ``StateSpace`` in discrete time, dt = Δ; states (x, x_o) at ticks
    an event rule                  linear plant: ``NonlinearIOSystem`` in discrete time, evaluated every ``dt``, so that
                                   events are late by up to ``dt``; states (x, x_o, x_h, time since the last event)
    =============================  ==================================================================================

    The inputs of a loop are d_<input>, which is added to the command, and n_<output>, an error of the observer's
    reading; its outputs are those of the plant and the commands u_<input>. For exact events use
    :func:`icmj.simulate_plant` and ``to_timeresponse()`` of the run.

    Args:
        plant: a linear plant, a plant from :func:`icmj.load_plant`, or a plant of a case.
        controller: design, hold and trigger; ``None`` for the plant alone.
        dt: interval at which an event rule is evaluated [s].
        match: how inputs and outputs of the plant are assigned to those of the controller's model.

    Raises:
        AnalysisError: if the controller is not intermittent, if there is a delay or a set-point, an event rule without
            ``dt`` or ``dt`` without an event rule, a MuJoCo model under other than continuous control, or plant and
            controller do not fit together.
    """
    given: Any = plant
    linear: LinearPlant = getattr(getattr(given, "linearisation", None), "plant", given)
    expect_linear(linear, "the plant")
    engine = plant if isinstance(plant, MujocoPlant) else None
    if controller is None:
        if engine is None:
            return linear.statespace()
        from icmj.engine.dynamics import plant_system

        return plant_system(engine)
    words = "it has no such form; simulate it with simulate_plant, and take to_timeresponse() of the run"
    expect(controller, Controller, "to_iosystem", words)
    trigger = controller.trigger
    if len(controller.realisation.signals):
        raise AnalysisError(
            "the controller has signals of its own (a set-point), which are not inputs of this form; remove them"
        )
    if (dt is None) != (trigger.kind != "event"):
        raise AnalysisError(
            "an event rule needs dt, the interval at which it is evaluated; to_iosystem(..., dt=1e-3)"
            if dt is None
            else f"dt is for event rules; a {trigger.kind} trigger has its own time"
        )
    if engine is not None:
        if trigger.kind != "continuous":
            raise AnalysisError(
                "a model on the engine has events inside its steps; take controller.triggered_by(Continuous()), its "
                "linear plant (plant.linearisation.plant), or to_timeresponse() of a run"
            )
        from icmj.engine.dynamics import continuous_loop as continuous_on_engine

        return continuous_on_engine(engine.matched(controller.design.plant, match), controller)
    from icmj.linear.systems import clocked_loop, continuous_loop, event_loop

    linear = match_ports(linear, controller.design.plant, match)
    if dt is not None:
        return event_loop(linear, controller, dt)
    return continuous_loop(linear, controller) if trigger.kind == "continuous" else clocked_loop(linear, controller)
