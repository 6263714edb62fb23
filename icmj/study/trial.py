"""One complete run under a controller that is not intermittent."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from icmj.case.case import PlantKind
    from icmj.case.trial import Trial
    from icmj.result.tried import Tried
    from icmj.runfile.schema import RunFile


def try_law(run: RunFile | Trial, plant: PlantKind, progress: Callable[[float], None] | None = None) -> Tried:
    """Simulate one controller that is not intermittent on one plant, with poses.

    Raises:
        IcmjError: if the run file, its models or the controller fail.
    """
    from icmj.case.trial import Trial, expect_measures, measured_by, prepare_trial, simulate_trial
    from icmj.engine.plant import MujocoPlant
    from icmj.engine.pose import scene
    from icmj.result.tried import Tried
    from icmj.simulation.remarks import remarks
    from icmj.simulation.scene import frames
    from icmj.work.provenance import provenance

    trial = run if isinstance(run, Trial) else prepare_trial(run)
    expect_measures(trial.run)
    simulation = simulate_trial(trial, plant, progress=None if progress is None else lambda done: progress(0.9 * done))
    run, actual, shown = trial.run, trial.actual, None
    if isinstance(actual, MujocoPlant):
        shown = scene(actual, simulation, run.study.magnification, frames(simulation.t))
    return Tried(
        run=run,
        assumed=trial.assumed.linearisation.plant,
        actual=actual.linearisation.plant,
        law=trial.law,
        simulation=simulation,
        scene=shown,
        provenance=provenance(run.path.parent),
        notices=tuple(str(notice) for notice in (*trial.notices, *remarks(simulation))),
        measures=measured_by(run, simulation),
    )
