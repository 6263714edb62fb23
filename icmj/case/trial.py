"""A controller that is not intermittent on the two plants of a run file: made, and simulated.

There is no critical interval and no event rule; all results come from simulations, and from the characteristic roots of
its loop in each mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from icmj.base.environment import single_threaded
from icmj.base.text import one_line
from icmj.case.case import PlantKind, expect_plant, simulate_plant
from icmj.case.designs import rival
from icmj.case.doubts import check_names, doubts, slow_noise
from icmj.case.plants import AnyPlant, actual_plant, assumed_plant, linear_plant
from icmj.controller.law import Law
from icmj.controller.predictor import PredictorController
from icmj.engine.plant import MujocoPlant
from icmj.errors import RunFileError, SimulationError, expect, named
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.notice import Notice, permitted
from icmj.runfile.schema import RunFile
from icmj.simulation.disturbance import expect_held
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation
from icmj.theory.delay_roots import DelayLoop, delay_loop, rightmost_roots
from icmj.theory.predictor_loop import predictor_loop

MOST_MODES = 16


@dataclass(frozen=True, eq=False)
class Trial:
    """The plants and the controller of a run file whose controller is not intermittent.

    Attributes:
        run: the run file.
        assumed, actual: the plants, as in :class:`icmj.case.case.Case`.
        law: the controller, made for the assumed plant.
        settings: settings of its runs.
        notices: notices about its plants and settings.
    """

    run: RunFile
    assumed: AnyPlant
    actual: AnyPlant
    law: Law
    settings: Settings
    notices: tuple[Notice, ...] = ()


@single_threaded()
def prepare_trial(run: RunFile, like: Trial | None = None) -> Trial:
    """Load and linearise both plants, and make the controller.

    Args:
        run: the run file.
        like: another trial, whose plants are reused if the run files agree on them.

    Raises:
        RunFileError: if the controller of the run file is intermittent, or the run file names something that its
            models do not have.
        ModelError, AnalysisError: if a plant or the controller fails.
        SimulationError: if a disturbance needs another controller.
    """
    expect(run, RunFile, "prepare_trial")
    run.rival  # noqa: B018, nothing is loaded for the intermittent one
    run = run.drawn()
    same = like and (like.run.assumed, like.run.actual, like.run.path) == (run.assumed, run.actual, run.path)
    assumed, actual = (like.assumed, like.actual) if like and same else _plants(run)
    check_names(run, assumed.linearisation.plant, actual)
    told = permitted(doubts(run, assumed, actual), run.analysis.allow, str(run.path))
    with named(run.path):
        law, settings = rival(run, assumed.linearisation.plant), run.simulation.settings()
        expect_held(law, settings)
    return Trial(run, assumed, actual, law, settings, (*told, *slow_noise(settings)))


def _plants(run: RunFile) -> tuple[AnyPlant, AnyPlant]:
    assumed = assumed_plant(run)
    return assumed, actual_plant(run, assumed)


def simulate_trial(
    trial: Trial, plant: PlantKind = "mujoco", *, progress: Callable[[float], None] | None = None
) -> Simulation:
    """Simulate a trial on the linear plant or in MuJoCo.

    Raises:
        SimulationError: if the simulation cannot be started.
        AnalysisError: if it is no trial.
    """
    expect(trial, Trial, "simulate_trial", "a Case is simulated by simulate")
    expect_plant(plant)
    if plant == "linear":
        there: AnyPlant | object = linear_plant(trial.actual, trial.settings)
    elif isinstance(trial.actual, MujocoPlant):
        there = trial.actual
    else:
        raise SimulationError(
            f"{trial.run.path}: the actual plant is given by matrices, which MuJoCo does not simulate; take the linear "
            "plant (--plant linear)"
        )
    return simulate_plant(there, trial.law, trial.settings, progress=progress, match="position")  # type: ignore[arg-type]


def expect_measures(run: RunFile) -> None:
    """See that the user's own measures may be called and are there, before the run that they measure.

    Raises:
        RunFileError: if not.
    """
    for reference in run.study.measures:
        run.code.named(reference)


def measured_by(run: RunFile, simulation: Simulation) -> dict[str, float]:
    """The results of the user's own measures for the run."""
    found: dict[str, float] = {}
    for reference in run.study.measures:
        told = run.code.made(reference, simulation)
        try:
            found |= {str(name): float(value) for name, value in dict(told).items()}
        except (TypeError, ValueError) as error:
            raise RunFileError(
                f"{run.path}: {reference}: expected numbers by name, got {one_line(repr(told), 60)}"
            ) from error
    return found


@single_threaded()
def mode_roots(trial: Trial, count: int = 4) -> dict[str, np.ndarray]:
    """The rightmost characteristic roots of the actual plant under the controller of a run file, mode by mode.

    They belong to a loop that stays in the mode, with all its delays (:func:`icmj.rightmost_roots`): the loop is stable
    in it if all lie to the left of 0. What a controller makes of modes between which it switches, its runs tell.

    Args:
        trial: plants and controller.
        count: at least so many roots of each mode [rad/s].

    Raises:
        AnalysisError: if they cannot be found, or the controller reads its outputs without a delay.
    """
    with named(trial.run.path):
        plant = linear_plant(trial.actual, trial.settings)
        return {name: rightmost_roots(loop, count) for name, loop in _loops(plant, trial.law).items()}


def _loops(plant: LinearPlant, law: Law) -> dict[str, DelayLoop]:
    if isinstance(law, PredictorController):
        return {"predictor": predictor_loop(plant, law)}
    return {mode.name: delay_loop(plant, law, i) for i, mode in enumerate(law.realisation.modes[:MOST_MODES])}
