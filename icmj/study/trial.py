"""One run under a controller that is not intermittent, complete; and measures of the user's own, of any run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from icmj.base.text import one_line
from icmj.errors import RunFileError
from icmj.runfile.schema import RunFile

if TYPE_CHECKING:
    from icmj.case.case import PlantKind
    from icmj.case.trial import Trial
    from icmj.result.tried import Tried
    from icmj.simulation.simulation import Simulation


def try_law(run: RunFile | Trial, plant: PlantKind, progress: Callable[[float], None] | None = None) -> Tried:
    """One controller that is not intermittent on one plant: the run, and poses.

    Raises:
        IcmjError: if the run file, its models or the controller fail.
    """
    from icmj.case.trial import Trial, prepare_trial, simulate_trial
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


def measured_by(run: RunFile, simulation: Simulation) -> dict[str, float]:
    """What measures of the user's own say of the run."""
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
