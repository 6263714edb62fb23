"""Where a run starts: the states of plant and controller that its settings give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.controller.controller import expect_intermittent, start_state
from icmj.controller.law import Law
from icmj.errors import SimulationError
from icmj.plant.linear_plant import LinearPlant
from icmj.simulation.readings import expect_no_observer, expect_ports, expect_readings
from icmj.simulation.settings import Settings


def start_states(
    plant: LinearPlant,
    controller: Law,
    settings: Settings,
    x: ArrayLike | None = None,
    x_o: ArrayLike | None = None,
    x_h: ArrayLike | None = None,
    a: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """The states at t = 0: of the plant, shape (n,), and of the controller, in its layout.

    Args:
        plant: the actual plant, or its linearisation.
        controller: says which states it has.
        settings: names the states that do not start at zero.
        x, x_o, x_h: whole vectors instead; the hold starts where the observer does if ``x_h`` is ``None``, because
            t = 0 is an event.
        a: state of a controller that has neither, right after an event, shape (N_a,); zero if ``None``.

    Raises:
        SimulationError: if a named state does not exist, a vector has the wrong shape or is not finite, or what the
            controller reads is not what the plant has.
    """
    if not controller.observed:
        expect_no_observer(controller, settings, x_o, x_h)
        size = expect_readings(controller, plant).layout.size
        return make_plant_start(plant, settings, x), make_controller_start(size, a)
    expect_ports(controller, plant)
    if (delay := controller.realisation.delay) >= settings.duration:
        raise SimulationError(
            f"the delay of {delay:g} s is not shorter than the run of {settings.duration:g} s: no event would ever act"
        )
    assumed = controller.plant.states
    plant_state = make_plant_start(plant, settings, x)
    observer = _start("observer", assumed, settings.observer, x_o)
    hold = observer if x_h is None else _start("hold", assumed, {}, x_h)
    return plant_state, start_state(expect_intermittent(controller), observer, hold)


def make_plant_start(plant: LinearPlant, settings: Settings, x: ArrayLike | None = None) -> Array:
    """The plant's state at t = 0, shape (n,), by name or as a whole vector.

    Raises:
        SimulationError: as for :func:`start_states`.
    """
    return _start("plant", plant.states, settings.initial, x)


def make_controller_start(size: int, a: ArrayLike | None = None) -> Array:
    """The state at t = 0 of a controller without a trigger, shape (size,): ``a``, or zero.

    Raises:
        SimulationError: if it has the wrong shape or is not finite.
    """
    return _start("controller", [str(i) for i in range(size)], {}, a)


def _start(what: str, names: Sequence[str], named: Mapping[str, float], given: ArrayLike | None) -> Array:
    if given is not None:
        state = np.array(given, dtype=float)
        if state.shape != (len(names),) or not np.isfinite(state).all():
            raise SimulationError(f"start state of the {what}: expected {len(names)} finite numbers, got {state}")
        return state
    for name in named:
        if name not in names:
            raise SimulationError(f"start state of the {what}: no state {name!r}; its states are {', '.join(names)}")
    return np.array([named.get(name, 0.0) for name in names], dtype=float)
