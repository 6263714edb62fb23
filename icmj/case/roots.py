"""The characteristic roots of a trial's loop, in each mode of its controller."""

from __future__ import annotations

import numpy as np

from icmj.base.environment import single_threaded
from icmj.case.plants import linear_plant
from icmj.case.trial import Trial
from icmj.controller.law import Law
from icmj.controller.predictor import PredictorController
from icmj.errors import named
from icmj.plant.linear_plant import LinearPlant
from icmj.theory.delay_roots import DelayLoop, delay_loop, rightmost_roots
from icmj.theory.predictor_loop import predictor_loop

MOST_MODES = 16


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
