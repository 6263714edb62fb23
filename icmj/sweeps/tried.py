"""The row of a point whose controller is not intermittent: the loop's rightmost root, and the results of its runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from icmj.case.case import PlantKind
from icmj.case.roots import mode_roots
from icmj.case.trial import Trial, measured_by, prepare_trial, simulate_trial
from icmj.comparison.comparison import finite
from icmj.errors import AnalysisError
from icmj.experiments.rounds import rounds_of
from icmj.runfile.schema import RunFile
from icmj.sweeps import columns


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
        row |= {f"{plant}_{name}": value for name, value in _motion(trial, plant).items()}
    return row


def _motion(trial: Trial, plant: PlantKind) -> dict[str, Any]:
    run = simulate_trial(trial, plant)
    found = rounds_of(run)
    late, outputs = run.y[run.t >= run.t[-1] / 2], trial.assumed.linearisation.plant.outputs
    return {
        "outcome": run.outcome.kind,
        "end": run.outcome.t,
        "switches": len(run.events),
        "growth": finite(found.growth),
        "factor": finite(found.factor),
        "period": finite(found.period),
        **{f"peak_{name}": finite(peak) for name, peak in zip(outputs, np.abs(late).max(axis=0), strict=True)},
        **columns.own(measured_by(trial.run, run)),
        **{f"rms_{name}": finite(rms) for name, rms in zip(outputs, late.std(axis=0), strict=True)},
    }
