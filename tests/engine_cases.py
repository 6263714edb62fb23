"""The closed loops that the engine's tests run: the published cases on MuJoCo."""

from functools import cache
from pathlib import Path

import numpy as np

from icmj import Controller, Deviation, EventTrigger, MujocoPlant, Prediction, load_plant, output_weight, predict
from icmj.controller.design import Design, design_lq
from icmj.controller.hold import system_matched
from icmj.theory.error_system import ErrorSystem, error_system

MODELS = Path(__file__).parents[1] / "models"


@cache
def plant(model: str, gain: float = 1.0) -> MujocoPlant:
    """A shipped model with every input scaled by ``gain``."""
    return load_plant(MODELS / f"{model}.xml", Deviation(gain=gain), keyframe="upright")


@cache
def design(model: str) -> Design:
    """The notes' design for a shipped model."""
    weights = {"pendulum": (0.1, 0.01), "three_link": (5e-7, 2e-7)}[model]
    return design_lq(plant(model).linearisation.plant, R_c=weights[0], R_o=weights[1])


def controller(model: str, q_t: float = 1e-2, delta_min: float = 1e-3) -> Controller:
    """System-matched hold, events weighted at the outputs."""
    gains = design(model)
    return Controller(gains, system_matched(gains), EventTrigger(output_weight(gains), q_t, delta_min))


def predicted(actual: MujocoPlant, control: Controller, delta_max: float = 3.0) -> Prediction:
    """The linear prediction."""
    system = error_system(actual.linearisation.plant, control.design, control.hold)
    return predict(system, control.trigger, delta_max=delta_max)


def orbit_start(actual: MujocoPlant, control: Controller, prediction: Prediction) -> dict[str, np.ndarray]:
    """Start states on the predicted orbit, as arguments of ``simulate``."""
    system: ErrorSystem = error_system(actual.linearisation.plant, control.design, control.hold)
    assert prediction.orbit is not None
    X = system.to_original(system.T_bar @ prediction.orbit.x_bar)
    n, m = system.n, system.n_hat
    return {"x0": X[:n], "x_o0": X[n : n + m], "x_h0": X[n + m :]}
