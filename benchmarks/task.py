"""The task that all are timed on: the three-link case at b = 0.9, started on its predicted cycle."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from icmj import (
    Controller,
    Deviation,
    EventTrigger,
    MujocoPlant,
    Settings,
    error_system,
    load_plant,
    output_weight,
    predict,
)
from icmj.controller.design import design_lq
from icmj.controller.hold import system_matched
from icmj.engine.closed_loop import ComposedLoop, close_loop

MODEL = Path(__file__).resolve().parent.parent / "models" / "three_link.xml"
Q_T = 1e-2


@dataclass(frozen=True, eq=False)
class Task:
    """Actual plant, controller, and a start on the predicted orbit (departures from the operating point)."""

    plant: MujocoPlant
    controller: Controller
    trigger: EventTrigger
    x: np.ndarray
    x_o: np.ndarray

    def loop(self) -> ComposedLoop:
        """A composed model of its own."""
        return close_loop(self.plant, self.controller, Settings())


@cache
def three_link() -> Task:
    """The task."""
    gains = design_lq(load_plant(MODEL, keyframe="upright").linearisation.plant, R_c=5e-7, R_o=2e-7)
    plant = load_plant(MODEL, Deviation(0.9), keyframe="upright")
    trigger = EventTrigger(output_weight(gains), Q_T)
    system = error_system(plant.linearisation.plant, gains)
    orbit = predict(system, trigger).orbit
    assert orbit is not None
    X = system.to_original(system.T_bar @ orbit.x_bar)
    return Task(plant, Controller(gains, system_matched(gains), trigger), trigger, X[:6], X[6:12])
