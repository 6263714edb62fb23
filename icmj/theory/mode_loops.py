"""The linear loops of a plant under a controller, one for each mode in which it may stay."""

from __future__ import annotations

from functools import singledispatch

from icmj.controller.law import Law
from icmj.controller.predictor import PredictorController
from icmj.plant.linear_plant import LinearPlant
from icmj.theory.delay_roots import DelayLoop, delay_loop
from icmj.theory.predictor_roots import predictor_loop

MOST_MODES = 16


@singledispatch
def list_loops(law: Law, plant: LinearPlant) -> dict[str, DelayLoop]:
    """The loops of ``plant`` under a controller that stays in one mode, by mode; of very many modes, of the first.

    Raises:
        AnalysisError: if the controller reads its outputs without a delay.
    """
    return {mode.name: delay_loop(plant, law, i) for i, mode in enumerate(law.realisation.modes[:MOST_MODES])}


@list_loops.register
def _(law: PredictorController, plant: LinearPlant) -> dict[str, DelayLoop]:
    return {law.kind: predictor_loop(plant, law)}
