"""One complete run under a controller that is not intermittent."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from icmj.errors import named

if TYPE_CHECKING:
    from icmj.case.case import PlantKind
    from icmj.case.trial import Trial
    from icmj.result.tried import Tried
    from icmj.runfile.schema import RunFile

PLENTY = 4000  # delays that a run on the linear plant may last before its work is estimated


def try_law(run: RunFile | Trial, plant: PlantKind, progress: Callable[[float], None] | None = None) -> Tried:
    """Simulate one controller that is not intermittent on one plant, with poses.

    Raises:
        IcmjError: if the run file, its models or the controller fail.
    """
    from icmj.case.trial import Trial, measured_by, prepare_trial, simulate_trial
    from icmj.engine.plant import MujocoPlant
    from icmj.engine.pose import scene
    from icmj.result.tried import Tried
    from icmj.simulation.remarks import remarks
    from icmj.simulation.scene import frames
    from icmj.work.provenance import provenance

    trial = run if isinstance(run, Trial) else prepare_trial(run)
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


def startable_trial(trial: Trial, plant: PlantKind) -> None:
    """See that a run can start, before anything is written for it.

    Raises:
        ModelError, SimulationError, AnalysisError: if it cannot.
    """
    from icmj.case.plants import linear_plant
    from icmj.engine.plant import MujocoPlant
    from icmj.engine.stepping import stepping_of
    from icmj.engine.tapped import close_tapped
    from icmj.simulation.settings import plant_start
    from icmj.simulation.taps import expect_no_observer, expect_tapped

    settings, actual = trial.settings, trial.actual
    there = linear_plant(actual, settings)
    with named(trial.run.path):
        expect_tapped(trial.law, there)
        expect_no_observer(trial.law, settings)
        plant_start(there, settings, None)
        if plant == "mujoco" and isinstance(actual, MujocoPlant):
            fitting = actual.matched(trial.law.plant, "position")
            stepping_of(close_tapped(fitting, trial.law, settings), settings)


def estimate_trial(trial: Trial, plant: PlantKind) -> float:
    """Seconds that the run will take, about, from a beginning of it; 0 where it is plainly quick."""
    from icmj.case.trial import simulate_trial

    settings, tap = trial.settings, trial.law.realisation.taps[0]
    short = (PLENTY if plant == "linear" else PLENTY / 10) * tap
    if settings.duration <= short:
        return 0.0
    beginning = replace(trial, settings=replace(settings, duration=short / 4))
    simulate_trial(beginning, plant)  # compiles
    begin = time.process_time()
    reached = float(simulate_trial(beginning, plant).t[-1])
    return (time.process_time() - begin) * settings.duration / max(reached, tap)
