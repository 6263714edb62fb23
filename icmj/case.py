"""The case: from a run file to plants, linearisation, design, error system and prediction; then to a simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from icmj.controller import HOLDS, Controller, EventTrigger, Trigger, as_weight
from icmj.design import Design, design_lq
from icmj.engine.model import Deviation
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.errors import IcmjError, RunFileError
from icmj.linear_plant import Array, LinearPlant
from icmj.runfile import RunFile, Weights
from icmj.simulation import Simulation
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.prediction import Prediction, predict

PlantKind = Literal["linear", "mujoco"]


@dataclass(frozen=True, eq=False)
class Case:
    """A run file made real.

    Attributes:
        run: the run file.
        assumed, actual: plants on the engine, each with its linearisation.
        controller: design on the assumed plant, hold and event trigger.
        system: error system of the actual plant under that controller.
        prediction: the linear theory of it.
    """

    run: RunFile
    assumed: MujocoPlant
    actual: MujocoPlant
    controller: Controller
    system: ErrorSystem
    prediction: Prediction


def prepare(run: RunFile) -> Case:
    """Load and linearise both plants, design the controller, form the error system, and predict.

    Raises:
        RunFileError: if the run file asks for what its models do not have; the message names the run file.
        ModelError, DesignError, AnalysisError: if a plant, a design or the analysis fails.
    """
    deviation = Deviation(run.actual.gain, run.actual.dynprm, run.actual.rho)
    assumed = load_plant(run.assumed_path, keyframe=run.assumed.keyframe)
    actual_keyframe = run.actual.keyframe or (run.assumed.keyframe if run.actual.model is None else None)
    actual = load_plant(run.actual_path, deviation, actual_keyframe)
    _check_names(run, assumed.linearisation.plant, actual.linearisation.plant)
    try:
        design = _design(assumed.linearisation.plant, run.design)
        trigger = EventTrigger(as_weight(run.controller.Q_t, design), run.controller.q_t, run.controller.delta_min)
        controller = Controller(design, HOLDS[run.controller.hold](design), trigger)
        system = error_system(actual.linearisation.plant, design, controller.hold)
        exact = error_system(assumed.linearisation.plant, design, controller.hold)
        prediction = predict(system, trigger, exact=exact, delta_max=run.analysis.delta_max)
    except IcmjError as error:
        raise type(error)(f"{run.path}: {error}") from error
    return Case(run, assumed, actual, controller, system, prediction)


def simulate(
    case: Case,
    plant: PlantKind = "mujoco",
    *,
    trigger: Trigger | None = None,
    start: tuple[Array, Array] | None = None,
    duration: float | None = None,
    refinement: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate a case on the linear plant (exactly) or on the engine.

    Args:
        case: the case.
        plant: ``linear`` or ``mujoco``.
        trigger: instead of the case's event trigger (a clock, or continuous control).
        start: plant and observer state at t = 0, shapes (n,) and (n̂,), instead of the run file's.
        duration: instead of the run file's [s].
        refinement: factor on the timestep of the run file or, where it has none, of the model.
        progress: called now and then with the fraction done, 0–1.

    Raises:
        SimulationError: if the simulation cannot be started.
    """
    settings = case.run.simulation
    if duration is not None:
        settings = settings.model_copy(update={"duration": duration})
    if refinement != 1.0:
        timestep = settings.timestep or case.actual.spec.option.timestep
        settings = settings.model_copy(update={"timestep": refinement * timestep})
    controller = case.controller if trigger is None else case.controller.triggered_by(trigger)
    x0, x_o0 = start if start is not None else (None, None)
    if plant == "linear":
        from icmj.linear.loop import simulate as simulate_linear

        return simulate_linear(
            case.actual.linearisation.plant, controller, settings, x0=x0, x_o0=x_o0, progress=progress
        )
    from icmj.engine.loop import simulate as simulate_mujoco

    return simulate_mujoco(case.actual, controller, settings, x0=x0, x_o0=x_o0, progress=progress)


def _design(plant: LinearPlant, weights: Weights) -> Design:
    def square(weight: str | list, named: Array) -> Array | list | float:
        if weight == "identity":
            return 1.0
        return named if isinstance(weight, str) else weight

    return design_lq(
        plant,
        Q_c=square(weights.Q_c, plant.C.T @ plant.C),
        R_c=weights.R_c,
        Q_o=square(weights.Q_o, plant.B @ plant.B.T),
        R_o=weights.R_o,
    )


def _check_names(run: RunFile, assumed: LinearPlant, actual: LinearPlant) -> None:
    """Names in the run file are checked before anything is computed from them."""
    settings = run.simulation
    wanted = [("simulation.initial", name, actual.states) for name in settings.initial]
    wanted += [("simulation.observer", name, assumed.states) for name in settings.observer]
    wanted += [("simulation.disturbance", d.input, actual.inputs) for d in settings.disturbance]
    for key, name, known in wanted:
        if name not in known:
            raise RunFileError(f"{run.path}: {key}: no {name!r} in the model; expected one of {', '.join(known)}")
