"""What a controller reads of a plant, checked: numbers of inputs and outputs, and shapes of its matrices."""

from __future__ import annotations

import numpy as np

from icmj.base.text import one_line
from icmj.controller.law import Law
from icmj.controller.realisation import Realisation
from icmj.errors import SimulationError
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.disturbance import expect_held
from icmj.simulation.settings import Settings


def expect_no_observer(law: Law, settings: Settings, *given: object) -> None:
    """Refuse initial values ``given`` for states that the controller does not have, and shares of its command.

    Raises:
        SimulationError: if there is one, or the settings name one.
    """
    expect_held(law, settings)
    if settings.observer or any(start is not None for start in given):
        raise SimulationError(f"a {law.kind} controller has neither observer nor hold; leave out where they start")


def expect_ports(law: Law, plant: LinearPlant) -> None:
    """Refuse a controller whose model has other numbers of inputs and outputs than the plant.

    Raises:
        SimulationError: if it has.
    """
    assumed = law.plant
    if (plant.n_u, plant.n_y) != (assumed.n_u, assumed.n_y):
        raise SimulationError(
            f"the plant has {plant.n_u} inputs and {plant.n_y} outputs, the controller's model "
            f"{assumed.n_u} and {assumed.n_y}; they must agree"
        )


def expect_readings(law: Law, plant: LinearPlant) -> Realisation:
    """The controller's realisation, if what it reads is what ``plant`` has.

    Raises:
        SimulationError: if its model has other numbers of inputs and outputs than the plant, or its matrices have other
            shapes than its readings.
    """
    realisation, assumed = law.realisation, law.plant
    if not isinstance(realisation, Realisation):
        raise SimulationError(
            f"the realisation of the {law.kind} controller is {one_line(repr(realisation), 60)}; expected a "
            "Realisation of icmj.controller.realisation"
        )
    expect_ports(law, plant)
    named = realisation.signals[:, 0]
    if np.any(named != np.floor(named)) or not np.all((named >= 0) & (named < realisation.signals_of(assumed.n_y))):
        raise SimulationError(
            f"a signal of the {law.kind} controller enters through reading {named.max():g} of those that are signals; "
            f"its N has {max(realisation.signals_of(assumed.n_y), 0)} of them, counted from 0"
        )
    direct = assumed.n_y * (realisation.taps[0] == 0)
    more = max(realisation.signals_of(assumed.n_y), 0) if len(realisation.signals) else 0
    each = assumed.n_y + (assumed.n_u if realisation.commands else 0)
    n_v = direct + each * len(realisation.delayed) + more
    for mode in realisation.modes:
        if mode.S.shape != (assumed.n_u, n_v):
            raise SimulationError(
                f"mode {mode.name!r} of the {law.kind} controller has S of shape {mode.S.shape}; expected "
                f"{(assumed.n_u, n_v)}"
            )
        if realisation.commands and mode.S[:, direct:].any():
            raise SimulationError(
                f"mode {mode.name!r} of the {law.kind} controller reads own commands, so S must be zero for delayed "
                "readings; let them move a state"
            )
    return realisation
