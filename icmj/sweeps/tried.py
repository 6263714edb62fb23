"""The row of a point whose controller is not intermittent: the loop's rightmost root, and the results of its runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from icmj.case.case import PlantKind
from icmj.case.roots import mode_roots
from icmj.case.trial import measured_by, prepare_trial, simulate_trial
from icmj.errors import AnalysisError
from icmj.experiments.rounds import rounds_of
from icmj.runfile.schema import RunFile
from icmj.sweeps import columns
from icmj.sweeps.facts import TRIED, Moved


def tried_row(run: RunFile, plants: Sequence[PlantKind]) -> dict[str, Any]:
    """The columns of one point, with the motion on each of ``plants``; a root that cannot be found is left out."""
    trial = prepare_trial(run)
    row: dict[str, Any] = {}
    try:
        root = next(iter(mode_roots(trial, 1).values()))[0]
        row |= {"root_real": float(root.real), "root_imag": abs(float(root.imag))}
    except AnalysisError:  # it reads its outputs as they are, or its rates are out of proportion to its delay
        pass
    for plant in plants:
        motion = simulate_trial(trial, plant)
        moved = Moved(motion, rounds_of(motion), motion.y[motion.t >= motion.t[-1] / 2])
        row |= columns.row_of(plant, TRIED, moved, trial.assumed.linearisation.plant.outputs)
        row |= {f"{plant}_{name}": value for name, value in columns.own(measured_by(trial.run, motion)).items()}
    return row
